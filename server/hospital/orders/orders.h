// Executes orders, across failures of peers and restarts of the daemon.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "server/hospital/orders/requests.h"
#include "server/hospital/orders/steps.h"

namespace isomesh::orders {

// Counts of failed attempts, for the metrics. Those of configured PACS begin with 0.
struct Attempts {
  std::string pacs;
  PacsFault fault = PacsFault::kUnreachable;
  std::uint64_t count = 0;
};

struct OrderOptions {
  std::chrono::hours keep{30 * 24};  // for ended orders
  std::function<store::Time()> now = [] { return std::chrono::system_clock::now(); };
  // The believed clock, which decides what expires; empty: the same as `now`.
  std::function<store::Time()> believed_now = {};
  // Makes this process responsible for orders or keeps it so; called each second. While it returns
  // a text, this process makes no steps and no orders of its own accord. Empty: always responsible.
  std::function<std::string()> keep_orders = {};
  // Called on stop; aborts long operations of steps, such as imports.
  std::function<void()> cut_off = {};
  // Removes what else is not kept since that time, and returns its number.
  std::function<std::size_t(store::Time before)> forget_also = {};
  std::size_t threads = 6;
  // Simultaneous steps per PACS, so that one that hangs does not block the others.
  std::size_t per_pacs = 2;
  // Simultaneous searches per PACS, and in total.
  std::size_t searches_per_pacs = 3;
  std::size_t searches = 6;
  std::chrono::milliseconds longest_search{30'000};
};

// Thread safe. Its dependencies must outlive it.
class Orders {
 public:
  // Starts work on open orders.
  Orders(const OrderServices& services, const HospitalSettings& settings, OrderOptions options);

  // Aborts running steps; the next process continues them.
  ~Orders();
  Orders(const Orders&) = delete;
  Orders& operator=(const Orders&) = delete;

  // As the destructor, but earlier. Call from one thread; afterwards call only methods that read.
  void stop();

  // Sets the listener for ended orders, which is called on the thread that ended the order. At most
  // one.
  void on_end(std::function<void(const std::string& order)> listener);

  // Throws as make_order does, and Error kKeyReused, kUnavailable. Second: true if the order is
  // new.
  std::pair<Order, bool> submit(const Orderer& orderer, const OrderRequest& request,
                                const std::string& idempotency_key,
                                const std::string& request_digest);

  // Throw Error kNotFound; retry also kNotReady.
  Order get(const store::Viewer& viewer, const std::string& id) const {
    return services_.orders.get(viewer, id);
  }
  Order cancel(const store::Viewer& viewer, const std::string& id);
  Order retry(const store::Viewer& viewer, const std::string& id);
  // Cancels the open order that claimed a workitem with that Transaction UID. Returns false if
  // there is none.
  bool cancel_performing(const std::string& transaction);

  std::vector<Order> list(const store::Viewer& viewer, const store::OrderFilter& filter,
                          const std::string& after, std::size_t limit) const {
    return services_.orders.list(viewer, filter, after, limit);
  }

  // Series of a PACS, the newest studies first. Each search is entered into the audit trail. Throws
  // Error kNotFound, kForbidden, kInvalidParameter without a part of the query that selects
  // studies, kUnavailable if too many searches are in progress or after stop(); and PacsFailure.
  PacsSeriesList search(const Orderer& orderer, const std::string& pacs, const SeriesQuery& query);

  // Tells that a job has ended; an order may wait for it.
  void job_ended(const std::string& job);

  // In the order of the configuration.
  std::vector<PacsStatus> pacs() const;

  std::vector<Attempts> attempts() const;
  store::OrderCounts counts() const { return services_.orders.counts(); }

  // True while this process is not responsible for orders.
  bool is_paused() const;

  // Checks for due orders; call after setting the clock.
  void wake();

 private:
  struct Running {
    std::string pacs;
    std::stop_source stop;
  };

  PacsSeriesList ask(const std::string& pacs, const SeriesQuery& query);
  void keep(const std::stop_token& stop);
  void pause(const std::string& reason);
  void go_on();
  // Makes orders due whose jobs may have ended while no process waited for them.
  void look_at_jobs();
  void work(const std::stop_token& stop);
  void watch(const std::string& pacs, const std::stop_token& stop);
  void forget_ended(const std::stop_token& stop);
  void forget();
  void receive(const std::stop_token& stop);
  store::ReceivedFate look_at_received(const store::HeldSeries& series);
  void look_at_rule(const Rule& rule, const std::stop_token& stop);
  void look_at_worklist(const Rule& rule, const std::stop_token& stop);
  void note_watch_failure(const Rule& rule, const std::string& pacs);
  // Takes the next due order for this thread; empty if there is none, or after `stop`.
  std::optional<std::string> take(const std::stop_token& stop, std::stop_token& cancelled);
  std::optional<std::string> take_one_of(const std::vector<store::OrderRecord>& due,
                                         const std::stop_token& stop, std::stop_token& cancelled);
  void give_back(const std::string& id);
  void advance(store::OrderRecord record, const std::stop_token& stop);
  void make_step(store::OrderRecord& record, const std::stop_token& stop,
                 std::vector<std::string>& stored);
  // `record` may already be at an earlier step than the failed one.
  void fail_step(store::OrderRecord& record, OrderState failed, const Error& error, bool may_pass,
                 std::chrono::seconds retry_after);
  void end(store::OrderRecord& record, const Error& error);
  void end_damaged(store::OrderRecord& record);
  // Saves the end of an order that has failed with that error.
  void save_failed(store::OrderRecord& record, Problem problem, const std::string& reason);
  void note_success(const std::string& pacs);
  void note_failure(const std::string& pacs, const PacsFailure& failure, const std::string& order);
  std::uint64_t generation() const;
  void wait_for_job(const Order& order);
  void ended(const std::string& order);
  void changed();
  void log(const store::OrderRecord& record, const std::string& reason) const;

  const OrderServices services_;
  const HospitalSettings& settings_;
  const OrderOptions options_;
  const OrderSteps steps_;

  mutable Mutex mutex_;
  Condition changed_;
  std::function<void(const std::string&)> on_end_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::string paused_ ISOMESH_GUARDED_BY(mutex_);                         // why; empty: not paused
  std::map<std::string, Running> running_ ISOMESH_GUARDED_BY(mutex_);     // by order
  std::map<std::string, std::string> by_job_ ISOMESH_GUARDED_BY(mutex_);  // waiting orders by job
  std::map<std::string, PacsStatus> status_ ISOMESH_GUARDED_BY(mutex_);
  std::map<std::pair<std::string, PacsFault>, std::uint64_t> failed_ ISOMESH_GUARDED_BY(mutex_);
  std::multiset<std::string> searched_ ISOMESH_GUARDED_BY(mutex_);  // PACS, once for each search
  std::stop_source searching_;
  std::vector<std::jthread> threads_;  // last: use all other members
};

}  // namespace isomesh::orders
