#include "server/hospital/orders/orders.h"

#include <algorithm>
#include <exception>
#include <random>
#include <set>

#include "base/clock.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/hospital/orders/unnamed.h"

namespace isomesh::orders {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using store::Time;

constexpr milliseconds kLongestSleep{1'000};
constexpr std::size_t kFirstDue = 200;
constexpr std::size_t kMostMeshing = 1'000'000;

// Exponential back-off with jitter over the upper half, so that orders that failed together do not
// retry together.
milliseconds delay_after(std::uint32_t failures, const HospitalSettings& settings) {
  constexpr std::uint32_t kMostDoublings = 20;
  const milliseconds whole = std::min<milliseconds>(
      settings.first_delay * (std::int64_t{1} << std::min(failures, kMostDoublings)),
      settings.longest_delay);
  thread_local std::mt19937_64 random{std::random_device()()};
  return milliseconds(
      std::uniform_int_distribution<std::int64_t>(whole.count() / 2, whole.count())(random));
}

// True if a retry may succeed, because the cause may be temporary.
bool may_pass(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUnavailable:
    case ErrorCode::kTooManyRequests:
    case ErrorCode::kOutOfSpace:
    case ErrorCode::kInternal:
    case ErrorCode::kNotFound:
    case ErrorCode::kPacsUnreachable:
    case ErrorCode::kSeriesIncomplete:
      return true;
    default:
      return false;
  }
}

// The names of those that rules watch for series or workitems.
std::set<std::string> watched_pacs(const std::vector<Rule>& rules) {
  std::set<std::string> all;
  for (const Rule& rule : rules) {
    if (rule.watch) all.insert(*rule.watch);
    if (rule.worklist) all.insert(*rule.worklist);
  }
  return all;
}

}  // namespace

Orders::Orders(const OrderServices& services, const HospitalSettings& settings,
               OrderOptions options)
    : services_(services),
      settings_(settings),
      options_(std::move(options)),
      steps_(services, settings, options_.now) {
  services_.audit.add({.event = store::AuditEvent::kStart});
  for (const PacsSettings& each : settings_.pacs) {
    status_[each.name].name = each.name;
    for (const PacsFault fault : kPacsFaults) failed_[{each.name, fault}] = 0;
  }
  look_at_jobs();
  try {
    if (options_.keep_orders) {
      threads_.emplace_back([this](const std::stop_token& stop) { keep(stop); });
    }
    for (std::size_t n = 0; n < options_.threads; ++n) {
      threads_.emplace_back([this](const std::stop_token& stop) { work(stop); });
    }
    for (const std::string& pacs : watched_pacs(settings_.rules)) {
      threads_.emplace_back([this, pacs](const std::stop_token& stop) { watch(pacs, stop); });
    }
    threads_.emplace_back([this](const std::stop_token& stop) { forget_ended(stop); });
    if (settings_.dimse) {
      threads_.emplace_back([this](const std::stop_token& stop) { receive(stop); });
    }
  } catch (...) {
    stop();  // otherwise what the running threads wait for would not be aborted
    throw;
  }
}

Orders::~Orders() { stop(); }

void Orders::stop() {
  searching_.request_stop();
  if (threads_.empty()) return;
  for (std::jthread& thread : threads_) thread.request_stop();
  {
    const Lock lock(mutex_);
    for (auto& [id, running] : running_) running.stop.request_stop();
    changed_.notify_all();
  }
  if (options_.cut_off) options_.cut_off();
  threads_.clear();
  on_end({});
  try {
    services_.audit.add({.event = store::AuditEvent::kStop});
  } catch (const std::exception& error) {
    log_error("the audit trail lacks the entry of this stop: {}", error.what());
  }
}

void Orders::look_at_jobs() {
  for (const Order& order :
       services_.orders.list(std::nullopt, {.state = OrderState::kMeshing}, "", kMostMeshing)) {
    services_.orders.hurry(order.id);
  }
}

void Orders::keep(const std::stop_token& stop) {
  constexpr seconds kPause{1};
  while (!stop.stop_requested()) {
    try {
      if (const std::string reason = options_.keep_orders(); !reason.empty()) {
        pause(reason);
      } else if (is_paused()) {
        go_on();
      }
    } catch (const std::exception& error) {
      log_error("orders stay paused, and going on is retried: {}", error.what());
    }
    isomesh::pause(stop, kPause);
  }
}

// Running steps end without a trace, as those of a process that ends: another one repeats them.
void Orders::pause(const std::string& reason) {
  const Lock lock(mutex_);
  for (auto& [id, running] : running_) running.stop.request_stop();
  if (paused_ == reason) return;
  paused_ = reason;
  log_warning("orders are paused here: {}", reason);
}

void Orders::go_on() {
  look_at_jobs();
  {
    const Lock lock(mutex_);
    paused_.clear();
  }
  log_info("orders are processed here again");
  changed();
}

bool Orders::is_paused() const {
  const Lock lock(mutex_);
  return !paused_.empty();
}

std::pair<Order, bool> Orders::submit(const Orderer& orderer, const OrderRequest& request,
                                      const std::string& idempotency_key,
                                      const std::string& request_digest) {
  using Kind = store::OrderSubmission::Kind;
  const store::OrderRecord record = make_order(settings_, orderer, request);
  if (const auto& labels = record.order.label_volume;
      labels && !services_.volumes.contains(record.owner, *labels)) {
    throw invalid_parameter("label_volume", "is not the id of a volume of the order's owner");
  }
  const store::OrderSubmission submission = services_.orders.submit(
      {.record = record, .idempotency_key = idempotency_key, .request_digest = request_digest},
      settings_.most_open);
  if (submission.kind == Kind::kConflict) {
    throw Error(ErrorCode::kKeyReused, "the idempotency key was used for another request");
  }
  if (submission.kind == Kind::kBusy) {
    throw Error(ErrorCode::kUnavailable, "too many orders are open");
  }
  changed();
  return {submission.order, submission.kind == Kind::kNew};
}

Order Orders::cancel(const store::Viewer& viewer, const std::string& id) {
  const auto [order, objects] = services_.orders.cancel(viewer, id);
  {
    const Lock lock(mutex_);
    if (const auto running = running_.find(id); running != running_.end()) {
      running->second.stop.request_stop();
    }
  }
  if (order.job && order.state == OrderState::kCancelled) {
    try {
      services_.jobs.cancel(std::nullopt, *order.job);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    }
  }
  erase_unnamed(services_.blobs, services_.volumes, objects);
  if (is_final(order.state)) ended(order.id);
  changed();
  return order;
}

bool Orders::cancel_performing(const std::string& transaction) {
  constexpr std::chrono::hours kEver{100'000};  // also those that wait
  const auto open = services_.orders.due(options_.now() + kEver, settings_.most_open);
  const auto found = std::ranges::find_if(open, [&](const store::OrderRecord& record) {
    return record.work.workitem && record.work.workitem->transaction == transaction;
  });
  if (found == open.end()) return false;
  // An order that is cancelled twice would not tell the worklist.
  if (!found->work.workitem->ending) cancel(store::Viewer(), found->order.id);
  return true;
}

Order Orders::retry(const store::Viewer& viewer, const std::string& id) {
  Order order = services_.orders.retry(viewer, id);
  changed();
  return order;
}

void Orders::job_ended(const std::string& job) {
  std::string order;
  {
    const Lock lock(mutex_);
    const auto waiting = by_job_.find(job);
    if (waiting == by_job_.end()) return;
    order = waiting->second;
    by_job_.erase(waiting);
  }
  services_.orders.hurry(order);
  changed();
}

std::vector<PacsStatus> Orders::pacs() const {
  const Lock lock(mutex_);
  std::vector<PacsStatus> all;
  for (const PacsSettings& each : settings_.pacs) all.push_back(status_.at(each.name));
  return all;
}

std::vector<Attempts> Orders::attempts() const {
  const Lock lock(mutex_);
  std::vector<Attempts> all;
  for (const auto& [what, count] : failed_) {
    all.push_back({.pacs = what.first, .fault = what.second, .count = count});
  }
  return all;
}

std::uint64_t Orders::generation() const {
  const Lock lock(mutex_);
  return generation_;
}

void Orders::wake() { changed(); }

void Orders::changed() {
  const Lock lock(mutex_);
  ++generation_;
  changed_.notify_all();
}

std::optional<std::string> Orders::take(const std::stop_token& stop, std::stop_token& cancelled) {
  if (is_paused()) return std::nullopt;
  // More orders than were fetched may wait for a PACS that hangs.
  for (std::size_t limit = kFirstDue;; limit *= 4) {
    const std::vector<store::OrderRecord> due = services_.orders.due(options_.now(), limit);
    if (auto id = take_one_of(due, stop, cancelled)) return id;
    if (due.size() < limit) return std::nullopt;
  }
}

std::optional<std::string> Orders::take_one_of(const std::vector<store::OrderRecord>& due,
                                               const std::stop_token& stop,
                                               std::stop_token& cancelled) {
  for (const store::OrderRecord& record : due) {
    const std::string pacs = OrderSteps::pacs_of(record);
    const Lock lock(mutex_);
    // stop() aborts only steps that have begun before.
    if (!paused_.empty() || stop.stop_requested()) return std::nullopt;
    const auto busy = std::ranges::count_if(running_, [&](const auto& running) {
      return !pacs.empty() && running.second.pacs == pacs;
    });
    if (static_cast<std::size_t>(busy) >= options_.per_pacs) continue;
    const auto [running, is_free] = running_.try_emplace(record.order.id, Running{pacs, {}});
    if (!is_free) continue;
    cancelled = running->second.stop.get_token();
    return record.order.id;
  }
  return std::nullopt;
}

void Orders::give_back(const std::string& id) {
  const Lock lock(mutex_);
  running_.erase(id);
  ++generation_;
  changed_.notify_all();
}

void Orders::work(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const std::uint64_t seen = generation();
    milliseconds sleep = kLongestSleep;
    bool is_in_trouble = false;
    try {
      std::stop_token cancelled;
      if (const auto id = take(stop, cancelled)) {
        const struct GiveBack {
          Orders& orders;
          const std::string& id;
          ~GiveBack() { orders.give_back(id); }
        } give_back{*this, *id};
        // Read again, because another thread may have made the step meanwhile.
        auto record = services_.orders.if_due(*id, options_.now());
        if (record) advance(*std::move(record), cancelled);
        continue;
      }
      if (const auto next = services_.orders.next_after(options_.now())) {
        const auto wait = std::chrono::ceil<milliseconds>(*next - options_.now());
        sleep = std::clamp(wait, milliseconds(1), kLongestSleep);
      }
    } catch (const std::exception& error) {
      log_error("orders could not be processed and are retried: {}", error.what());
      is_in_trouble = true;  // for example, the database is read-only: wait before the next attempt
    }
    Lock lock(mutex_);
    changed_.wait_for(lock, stop, sleep, [&]() ISOMESH_REQUIRES(mutex_) {
      return !is_in_trouble && generation_ != seen;
    });
  }
}

void Orders::advance(store::OrderRecord record, const std::stop_token& stop) {
  // Also after an exception: nobody else knows objects of a step that could not be saved.
  struct Objects {
    const OrderServices& services;
    const store::OrderRecord& record;
    std::vector<std::string> named;
    std::vector<std::string> stored = {};

    ~Objects() {
      // All other steps leave them named, and asking takes a query for each.
      if (!is_final(record.order.state) && record.work.blobs == named) named.clear();
      erase_unnamed(services.blobs, services.volumes, std::move(named), stored);
    }
  } objects{services_, record, services_.orders.blobs(record.order.id)};
  make_step(record, stop, objects.stored);
}

void Orders::make_step(store::OrderRecord& record, const std::stop_token& stop,
                       std::vector<std::string>& stored) {
  if (record.is_damaged) return end_damaged(record);
  const std::string pacs = OrderSteps::pacs_of(record);
  const OrderState before = record.order.state;
  try {
    steps_.advance(record, stop, stored);
    if (!pacs.empty()) note_success(pacs);
    if (record.order.state == OrderState::kMeshing && record.order.job) wait_for_job(record.order);
    if (is_final(record.order.state)) ended(record.order.id);
    if (record.order.state != before) log(record, "");
    changed();
  } catch (const OrderIsOver&) {
  } catch (const PacsFailure& failure) {
    if (stop.stop_requested()) return;
    note_failure(pacs, failure, record.order.id);
    fail_step(record, before, failure, failure.may_pass(), failure.retry_after());
  } catch (const Error& error) {
    // The order was cancelled, or the next process continues it.
    if (stop.stop_requested()) return;
    fail_step(record, before, error, may_pass(error.code()), {});
  } catch (const std::exception& error) {
    fail_step(record, before, Error(ErrorCode::kInternal, error.what()), true, {});
  }
}

void Orders::wait_for_job(const Order& order) {
  {
    const Lock lock(mutex_);
    by_job_[*order.job] = order.id;
  }
  // The job may have ended before by_job_ was set.
  if (is_final(services_.jobs.get(std::nullopt, *order.job).state)) job_ended(*order.job);
}

void Orders::ended(const std::string& order) {
  std::function<void(const std::string&)> listener;
  {
    const Lock lock(mutex_);
    listener = on_end_;
  }
  if (listener) listener(order);
}

void Orders::on_end(std::function<void(const std::string& order)> listener) {
  const Lock lock(mutex_);
  on_end_ = std::move(listener);
}

void Orders::fail_step(store::OrderRecord& record, OrderState failed, const Error& error,
                       bool may_pass, seconds retry_after) {
  const Time now = options_.now();
  const bool is_over = now - time_of(record.work.begun) >= settings_.give_up;
  if (!may_pass || is_over) return end(record, error);
  Order& order = record.order;
  // A PACS may ask for any time.
  const milliseconds delay =
      std::max<milliseconds>(delay_after(record.work.failures, settings_),
                             std::min<seconds>(retry_after, store::kLongestWait));
  ++record.work.failures;
  record.work.failed_in = std::max(record.work.failed_in, std::optional(failed));
  ++order.attempts;
  const auto& workitem = record.work.workitem;
  // The reason of the order's failure stays, whatever happens when the worklist is told.
  if (!workitem || workitem->ending != OrderState::kFailed)
    order.error = to_problem(error, "/v1/orders/" + order.id);
  const Time next = now + std::min<milliseconds>(delay, settings_.give_up);
  order.next_attempt = timestamp_of(next);
  if (!services_.orders.save(record, next)) return;
  log(record, std::string(describe(error.code()).name));
  if (error.code() == ErrorCode::kInternal) {
    log_error("a step of order {} failed and is retried: {}", order.id, error.what());
  }
  changed();
}

void Orders::end(store::OrderRecord& record, const Error& error) {
  save_failed(record, to_problem(error, "/v1/orders/" + record.order.id),
              std::string(describe(error.code()).name));
}

// The order itself is lost, so no step can be made.
void Orders::end_damaged(store::OrderRecord& record) {
  Problem problem =
      to_problem(Error(ErrorCode::kInternal, "damaged"), "/v1/orders/" + record.order.id);
  problem.detail = "the record of this order is damaged: submit the order again";
  save_failed(record, problem, "damaged");
}

void Orders::save_failed(store::OrderRecord& record, Problem problem, const std::string& reason) {
  // The reason of the order's failure stays, whatever happens when the worklist is told.
  const auto& workitem = record.work.workitem;
  if (workitem && workitem->ending == OrderState::kFailed && record.order.error) {
    problem = *record.order.error;
  }
  Order& order = record.order;
  if (store::end_at_worklist(record, OrderState::kFailed)) {
    order.error = problem;
    if (!services_.orders.save(record, options_.now())) return;
    log(record, reason);
    return changed();
  }
  const bool is_cancelled = workitem && workitem->ending == OrderState::kCancelled;
  order.state = is_cancelled ? OrderState::kCancelled : OrderState::kFailed;
  order.finished = timestamp_of(options_.now());
  order.next_attempt.reset();
  order.error = problem;
  if (!services_.orders.save(record, options_.now())) return;
  log(record, reason);
  ended(order.id);
  changed();
}

void Orders::note_success(const std::string& pacs) {
  const Lock lock(mutex_);
  if (const auto status = status_.find(pacs); status != status_.end()) {
    status->second.last_success = timestamp();
  }
}

void Orders::note_failure(const std::string& pacs, const PacsFailure& failure,
                          const std::string& order) {
  if (failure.fault() == PacsFault::kUnauthorized) {
    services_.audit.add({.event = store::AuditEvent::kAuthenticationFailure,
                         .success = false,
                         .order = order,
                         .peer_name = pacs});
  }
  const Lock lock(mutex_);
  ++failed_[{pacs, failure.fault()}];
  if (const auto status = status_.find(pacs); status != status_.end()) {
    status->second.last_failure = timestamp();
    status->second.reason = std::string(to_string(failure.fault()));
  }
}

void Orders::log(const store::OrderRecord& record, const std::string& reason) const {
  const Order& order = record.order;
  LogLine line("order", order.state == OrderState::kFailed ? LogLevel::kWarn : LogLevel::kInfo);
  line.add("id", order.id).add("state", to_string(order.state)).add("attempts", order.attempts);
  if (order.rule) line.add("rule", *order.rule);
  if (order.job) line.add("job", *order.job);
  if (!reason.empty()) line.add("reason", reason);
}

}  // namespace isomesh::orders
