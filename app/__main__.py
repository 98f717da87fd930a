"""`python -m app`: the command line where its console script is not on the path, as for child processes of `serve`."""

from app.cli.main import main

if __name__ == "__main__":
    main()
