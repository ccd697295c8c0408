-- GET of the path that is given.
dofile(debug.getinfo(1, "S").source:match("^@(.*/)") .. "row.lua")

function init(args) wrk.path = args[1] end

function done(summary, latency) print_row(summary, latency, "") end
