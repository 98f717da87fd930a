"""A verdict in words for who reads it: what it says, what it rests on, what to do next."""
