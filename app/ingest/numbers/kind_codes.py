"""A bit for each kind of field in a column of numbers."""

WHOLE = 1
POINT, COMMA = 2, 4  # this one stands before decimals for sure
DOUBTFUL_POINT, DOUBTFUL_COMMA = 8, 16  # it may as well part thousands
WORD = 32  # neither digits nor marks
OTHER = 64
