-- A daemon after the seed paper's Algorithm 1, to be measured beside ours. Usage: lua5.4 paper_daemon.lua HOST PORT
-- A client that says anything is told the length of the process list; then, one connection each, 8,000 bytes of it.

local socket = require("socket")

local PIECE_BYTES = 8000
local LIST = [[ps -e -o comm,pid,%cpu,sz | awk '
    NR == 1 { printf "["; next }
    {
        name = $0
        sub(/ +[0-9]+ +[0-9.]+ +[0-9]+ *$/, "", name)
        gsub(/["\\]/, "\\\\&", name)
        printf "%s{\"name\":\"%s\",\"pid\":%s,\"cpu\":%s,\"mem\":%s}", (NR > 2 ? "," : ""), name, $(NF-2), $(NF-1), $NF
    }
    END { printf "]" }']]

local function process_list()
    local pipe = assert(io.popen(LIST))
    local text = pipe:read("a")
    pipe:close()
    return text
end

local server = assert(socket.bind(arg[1], tonumber(arg[2])))
local rest = ""
while true do
    local client = server:accept()
    client:settimeout(5)
    if client:receive(1) then
        if rest == "" then
            rest = process_list()
            client:send(tostring(#rest))
        else
            client:send(rest:sub(1, PIECE_BYTES))
            rest = rest:sub(PIECE_BYTES + 1)
        end
    end
    client:close()
end
