"""The HTTP API: routes, their models and their errors. Everything a route does, it asks a service for."""
