// What the log and the metrics say beside requests: jobs that end, volumes that are refused,
// callbacks.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "proto/types.h"
#include "server/callbacks/callbacks.h"
#include "server/http/app/app.h"
#include "server/http/observe/metrics.h"
#include "server/http/requests/request.h"

namespace isomesh::http {

// Logs and counts a job that has just ended, and has its callback sent. A job that was deleted
// since is neither logged nor counted.
void report_ended(App& app, const std::string& job);

// Logs and counts an upload, or a part of it, that became no volume.
void report_import_refused(App& app, const Request& request, const Error& error);

// Calls `add`, which makes volumes of an upload, and reports the Error that it throws.
template <class Add>
auto counting_refusals(App& app, const Request& request, const Add& add) {
  try {
    return add();
  } catch (const Error& error) {
    report_import_refused(app, request, error);
    throw;
  }
}

// An observer that logs and counts attempts to call back. The metrics must outlive it.
callbacks::CallbackObserver callback_reporter(Metrics& metrics);

}  // namespace isomesh::http
