"""An audit as JSON: its line, its flat twin for tables, the stored row, and what is stored beside."""
