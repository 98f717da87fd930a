"""An API process for the load test: serves the data folder of its environment on the socket that it inherits."""

import sys

import uvicorn

from app.main import create_app
from app.settings import Settings

if __name__ == "__main__":
    uvicorn.run(create_app(Settings()), fd=int(sys.argv[1]), log_level="critical")
