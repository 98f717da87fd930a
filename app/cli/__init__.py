"""The command line: results on stdout, messages on stderr, exit codes that scripts can use."""
