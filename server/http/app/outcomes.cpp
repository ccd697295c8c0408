#include "server/http/app/outcomes.h"

#include "base/log.h"
#include "proto/fields.h"

namespace isomesh::http {
namespace {

void log_ended(const store::JobAccount& account) {
  const Job& job = account.job;
  LogLine line("job");
  line.add("id", job.id)
      .add("state", to_string(job.state))
      .add("priority", to_string(job.parameters.priority))
      .add("attempts", account.attempts);
  visit(job.timing, [&](const char* stage, double milliseconds) {
    line.add(std::string(stage) + "_ms", milliseconds);
  });
  if (job.mesh) line.add("triangles", job.mesh->triangles);
  // Only the code: a detail may quote a volume's header.
  if (job.error) line.add("reason", describe(to_error(*job.error).code()).name);
}

}  // namespace

void report_ended(App& app, const std::string& id) {
  store::JobAccount account;
  try {
    account = app.services.jobs.account(id);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kGone && error.code() != ErrorCode::kNotFound) throw;
    return app.services.callbacks.wake();  // the job may have a callback
  }
  if (account.job.parameters.callback) app.services.callbacks.wake();
  app.metrics.count_ended(account.job);
  log_ended(account);
}

callbacks::CallbackObserver callback_reporter(Metrics& metrics) {
  return [&metrics](const store::Delivery& delivery, callbacks::CallbackOutcome outcome,
                    const std::string& reason) {
    metrics.count(outcome);
    const bool is_lost = outcome == callbacks::CallbackOutcome::kGivenUp;
    LogLine line("callback", is_lost ? LogLevel::kError : LogLevel::kInfo);
    line.add("job", delivery.job)
        .add("result", name_of(outcome))
        .add("attempt", delivery.attempts + 1);
    if (!reason.empty()) line.add("reason", reason);
  };
}

void report_import_refused(App& app, const Request& request, const Error& error) {
  app.metrics.count_refused(error.code());
  LogLine("import_refused")
      .add("id", request.context.trace.request_id())
      .add("reason", describe(error.code()).name);
}

}  // namespace isomesh::http
