-- Jobs over the volume that is given, each with an iso-value of its own so that none is answered from
-- another's result, and each waited for. What a job costs beyond its own work (loading, extracting,
-- smoothing, encoding, as it reports them) is the rest of the time until its answer, where jobs come
-- alone and wait for nobody.
dofile(debug.getinfo(1, "S").source:match("^@(.*/)") .. "row.lua")

local threads = {}

function setup(thread)
  thread:set("number", #threads)
  table.insert(threads, thread)
end

function init(args)
  volume = args[1]
  alone = args[2] == "alone"
  count = 0
  ended = 0
  work = 0
  -- Of this run and this thread alone: a second has room for ten thousand jobs.
  first = (os.time() % 10000) * 1e-5 + number * 0.2
  headers = { ["Content-Type"] = "application/json", ["Prefer"] = "wait=30" }
end

function request()
  count = count + 1
  local body = string.format('{"volume": "%s", "iso": %.10f, "passes": 5}', volume,
    50 + first + count * 1e-9)
  return wrk.format("POST", "/v1/jobs", headers, body)
end

function response(status, headers, body)
  if not body:find('"state":"succeeded"', 1, true) then return end
  local timing = body:match('"timing":(%b{})')
  for _, stage in ipairs({ "load", "extract", "smooth", "encode" }) do
    work = work + tonumber(timing:match('"' .. stage .. '":([%d.e+-]+)'))
  end
  ended = ended + 1
end

function done(summary, latency)
  local all_work, all_ended = 0, 0
  for _, thread in ipairs(threads) do
    all_work = all_work + thread:get("work")
    all_ended = all_ended + thread:get("ended")
  end
  if all_ended == 0 then return print_row(summary, latency, "no job ended in time") end
  local mean = all_work / all_ended
  local beyond = string.format(", %.2f ms beyond it", latency.mean / 1000 - mean)
  print_row(summary, latency, string.format("%.2f ms of work%s, on average", mean,
    threads[1]:get("alone") and beyond or ""))
end
