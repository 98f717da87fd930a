"""The pure engine: recording -> audit, recording + simulation -> explanation."""

ENGINE_VERSION = "0.1.0"
