"""What plants and attackers send in place of words, numbers and bodies."""

WORDS = (
    *(
        "",
        " ",
        "\0",
        "\n",
        "\r\nX-Injected: 1",
        "x" * 10_000,
        "é塔\U0001f600",
        "\ud83d",
        "\u202e",
        "%00",
        "%",
        "%zz",
        "+",
    ),
    *(
        "'; DROP TABLE loops;--",
        "' OR '1'='1",
        "<script>alert(1)</script>",
        "=cmd|'/C calc'!A0",
        "{{7*7}}",
        "${jndi:x}",
    ),
    *(
        "../../etc/passwd",
        "..%2f..%2fetc",
        "/",
        "//",
        "\\\\server\\share",
        "file:///etc/passwd",
        "http://169.254.169.254/",
    ),
    *("null", "None", "true", "[]", "{}", "[object Object]", "undefined", "NaN", "nan", "Infinity", "-inf", "1e400"),
    *("0", "-0", "-1", "1", "2", "1.5", "1e3", "0x10", "１２", "²", "٣", "9" * 18, "9" * 19, "9" * 400, "1_000"),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775809", "4294967296", "2147483648"),
    *("2024-01-01T00:00:00Z", "0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00", "2024-02-30T00:00:00Z"),
    *("2024-03-31T02:30:00", "1677-09-21T00:12:43Z", "2262-04-12T00:00:00Z", "0", "1e18", "-1e18", "2024", "now"),
    *("Europe/Berlin", "../UTC", "Etc/GMT+12", "UTC\0", "localtime", "posixrules", "Factory", "EST5EDT", "/UTC", "."),
    *("WyJ4Il0", "eyJhIjoxfQ", "W251bGxd", "WzFd", "W10", "WzEsMl0", "WzFlNDAwXQ", "W05hTl0", "====", "W1tbXV1d"),
)

NUMBERS = (0, -1, 1, 0.5, -0.0, 1e-320, 1e308, -1e308, 2**31, 2**53 + 1, 2**63, -(2**63) - 1, 10**40, 1e400, -1e400)
RAW_NUMBERS = (b"NaN", b"Infinity", b"-Infinity", b"1e400", b"-1e400", b"1" * 5000, b"1e-5000", b"0.1" + b"0" * 5000)

VALUES = (None, True, False, [], {}, [[]], [None], {"": None}, "", *NUMBERS)

BODIES = (
    *(b"", b" ", b"\0", b"null", b"[]", b"{}", b"0", b'"x"', b"{", b'{"a":', b"[" * 100_000, b'{"a":' * 50_000),
    *(
        b"\xff\xfe\x00",
        b"\xef\xbb\xbf{}",
        b'{"tags":["\\ud800"]}',
        b'{"tags":["\\u0000"]}',
        b'{"tags":' + b"9" * 5000 + b"}",
    ),
    *(b'{"a":1,"a":2}', b"--x\r\n", b"a=1&b=2", b"%", b"a=%ff%00", b"text=" + b"%41" * 5000),
)

KINDS = (
    *("application/json", "application/json; charset=utf-16", "text/plain", "text/csv", "application/octet-stream"),
    *(
        "application/x-www-form-urlencoded",
        "multipart/form-data",
        "multipart/form-data; boundary=",
        "",
        "/",
        "x" * 3000,
    ),
    *("multipart/form-data; boundary=x", "application/xml", "application/gzip", "application/json; charset=\0"),
)

# name, value of headers that code looks at
HEADERS = (
    *(
        ("if-none-match", "*"),
        ("if-none-match", '"' + "a" * 5000),
        ("if-none-match", 'W/"x", "y"'),
        ("if-none-match", "\xff"),
    ),
    *(("origin", "http://evil.example"), ("origin", "null"), ("origin", "::"), ("origin", "http://["), ("origin", "")),
    *(
        ("sec-fetch-site", "cross-site"),
        ("sec-fetch-site", "same-origin"),
        ("sec-fetch-site", "none"),
        ("sec-fetch-site", "?"),
    ),
    *(("content-encoding", "gzip"), ("content-encoding", "br"), ("content-encoding", ","), ("accept", "text/html")),
    *(
        ("x-request-id", "a" * 10_000),
        ("x-request-id", "\r\n"),
        ("x-request-id", "abc-1"),
        ("x-forwarded-proto", "https"),
    ),
    *(("cookie", "loopaudit_session="), ("cookie", "loopaudit_session=\xff; ="), ("cookie", ";" * 5000)),
    *(
        ("cookie", "__Host-loopaudit_session=x"),
        ("x-csrf-token", "x"),
        ("x-csrf-token", "\xff"),
        ("range", "bytes=0-,0-,9-1"),
    ),
    *(("range", "bytes=-99999999999"), ("if-modified-since", "x"), ("if-range", "x"), ("content-length", "-1")),
    *(
        ("content-length", "99999999999999"),
        ("content-length", "x"),
        ("content-length", "٣"),
        ("expect", "100-continue"),
    ),
    *(
        ("authorization", "Basic YTpi"),
        ("authorization", "Bearer"),
        ("authorization", "Bearer \xff\xfe"),
        ("x-api-key", ""),
    ),
    *(("authorization", "Bearer la_read_x_" + "A" * 3000), ("authorization", "Bearer la_admin_aaaaaaaa_" + "a" * 49)),
)

HOSTS = ("localhost", "127.0.0.1:8000", "evil.example", "", "[::1]:80", "[", "a" * 500, "\xff", "localhost:x")
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "get", "X" * 50)
