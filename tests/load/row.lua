-- One row of the table that `run` prints, from what wrk counted. `beside` tells what else there is.
function print_row(summary, latency, beside)
  local errors = summary.errors
  local failed = errors.connect + errors.read + errors.write + errors.status + errors.timeout
  print(string.format("row %.0f | %.2f | %.2f | %d | %s",
    summary.requests / (summary.duration / 1e6), latency:percentile(50) / 1000,
    latency:percentile(99) / 1000, failed, beside))
end
