// What the log and the metrics say beside requests: jobs that end, volumes that are refused,
// callbacks.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/http/metrics.h"
#include "server/jobs/callbacks.h"

namespace isomesh::http {

struct App;

// Logs and counts a job that has just ended, and has its callback sent. One that has expired
// already is neither logged nor counted.
void record_ended(App& app, const std::string& job);

// Calls `add`, which makes a volume of an upload, and counts what it refuses.
std::pair<Volume, bool> recording_refusals(App& app,
                                           const std::function<std::pair<Volume, bool>()>& add);

// Logs and counts attempts to call back. The metrics must outlive what it returns.
jobs::CallbackObserver callback_recorder(Metrics& metrics);

}  // namespace isomesh::http
