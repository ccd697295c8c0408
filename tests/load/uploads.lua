-- Raw volumes of 2 MiB, each other than all before.
dofile(debug.getinfo(1, "S").source:match("^@(.*/)") .. "row.lua")

local threads = 0
local kBytes = 128 * 128 * 128

function setup(thread)
  thread:set("number", threads)
  threads = threads + 1
end

function init()
  count = 0
  rest = string.rep("isomesh!", kBytes / 8):sub(25)
  headers = { ["Content-Type"] = "application/octet-stream" }
  path = "/v1/volumes?dims=128,128,128&type=uint8"
end

function request()
  count = count + 1
  local name = string.format("%012d%04d%08d", os.time(), number, count)
  return wrk.format("POST", path, headers, name .. rest)
end

function done(summary, latency)
  local mebibytes = summary.requests * kBytes / (1024 * 1024) / (summary.duration / 1e6)
  print_row(summary, latency, string.format("%.0f MiB/s", mebibytes))
end
