// Logs and metrics of events outside of requests: ended jobs, rejected volumes, callbacks.
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

// Logs and counts a job that has just ended, and triggers its callback. Does neither for a job
// deleted meanwhile.
void report_ended(App& app, const std::string& job);

// Logs and counts an upload, or a part of it, that was rejected.
void report_import_refused(App& app, const Request& request, const Error& error);

// Calls `add`, which imports an upload, and reports its Error.
template <class Add>
auto counting_refusals(App& app, const Request& request, const Add& add) {
  try {
    return add();
  } catch (const Error& error) {
    report_import_refused(app, request, error);
    throw;
  }
}

// An observer that logs and counts callback attempts. The metrics must outlive it.
callbacks::CallbackObserver callback_reporter(Metrics& metrics);

}  // namespace isomesh::http
