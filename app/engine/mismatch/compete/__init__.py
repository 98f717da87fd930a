"""Which physics is missing: contenders alone and in pairs, what each is worth, and which are believed."""
