"""Limits on everything that a client can make grow: by connection, by address, and in total.

The same numbers stand in docs/reference/limits.md. What is asked for beyond one of them is answered by an
error that names it; a stop is subject to none of them.
"""

# Connections
CLIENTS = 64  # who may ask for everything …
CLIENTS_OF_ONE_ADDRESS = 56  # … and how many of these from one address
STOPPERS = 256  # beyond them, who may only stop; half of them at most from one address
SPEAK_S = 20.0  # how long a client may say nothing at first
BAD_LINES = 8  # that are no requests, and the connection is ended
HANDSHAKES = 8  # of TLS at a time …
HANDSHAKE_S = 3.0  # … each for so long
HANDSHAKES_WAITING = 64  # for their turn; beyond, one that says nothing is closed, else who comes …
HANDSHAKES_WAITING_OF_ONE_ADDRESS = 16  # … and how many of these from one address

# Requests
LINE_LIMIT = 64 * 1024  # without its newline
NAME_LENGTH = 64  # characters of a client's name
REASON_LENGTH = 200  # characters of a stop's reason
NAMES = 2048  # that one request may list
NAME_OR_GLOB_LENGTH = 200  # characters of each
GLOBS = 64  # of these with * ? or [ …
WILD_CARDS = 12  # … and so many of these in one
OBJECTS_LISTED = 256  # of a device's dictionary in one answer
OBJECTS_READ = 64  # that one request may read of a device
QUEUED_LINES = 1024  # requests of one client that may wait to be handled …
QUEUED_BYTES = 1024 * 1024  # … and their bytes; what comes beyond is refused
PENDING = 64  # requests of one client that wait for a device before the next is handled
MOST_STOPS = 1024  # stops of one client whose answer is waited for; beyond, they act and are not answered
ID_LENGTH = 200  # characters of a stop's id; a longer one is answered as null
OUTPUT_BYTES = 1024 * 1024  # answers a client has not taken before its next request is handled …
OUTPUTS_BYTES = 64 * 1024 * 1024  # … and of all clients; beyond, who has most of it is closed

# Streams. What a stream costs a second: its rate times its channels and `ROW_VALUES` more.
STREAMS = 32  # of one client
ROW_VALUES = 60  # what a row costs beside its values
OWN_RATE_HZ = 1000.0  # what a source's own samples are counted as
VALUES_A_SECOND = 900_000  # of one client's streams …
ALL_VALUES_A_SECOND = 2_700_000  # … and of all that differ
SMALL_VALUES_A_SECOND = 30_000  # a client that asks for no more is always served
