// What the log and the metrics say beside requests: jobs that end, volumes that are refused,
// callbacks.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/callbacks/callbacks.h"
#include "server/http/observe/metrics.h"
#include "server/http/request.h"

namespace isomesh::http {

struct App;

// Logs and counts a job that has just ended, and has its callback sent. A job that was deleted
// since is neither logged nor counted.
void report_ended(App& app, const std::string& job);

// Calls `add`, which makes a volume of an upload, and logs and counts the Error that it throws.
std::pair<Volume, bool> counting_refusals(App& app, const Request& request,
                                          const std::function<std::pair<Volume, bool>()>& add);

// An observer that logs and counts attempts to call back. The metrics must outlive it.
callbacks::CallbackObserver callback_reporter(Metrics& metrics);

}  // namespace isomesh::http
