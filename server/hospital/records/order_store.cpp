#include "server/hospital/records/order_store.h"

#include <algorithm>
#include <map>
#include <set>

#include "proto/error.h"
#include "server/hospital/records/order_rules.h"
#include "server/store/damaged_records.h"
#include "server/store/microseconds.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/undamaged_rows.h"

namespace isomesh::store {
namespace {

// Locked while an order is made, because that depends on the existing orders.
constexpr const char* kOrders = "orders";

constexpr DamagedTable kOrderTable = {"orders", "SELECT record FROM orders", "id", "id DESC"};

// Databases and their indexes contain these numbers, so they stay. `state < 4` are the open orders.
static_assert(static_cast<int>(OrderState::kSucceeded) == 4);
static_assert(static_cast<int>(OrderState::kCancelled) == 6);

// The columns that record_of() reads.
constexpr const char* kColumns =
    "SELECT owner, record, work, id, state, coalesce(rule, ''), created FROM orders ";

std::optional<OrderWork> readable_work(const std::string& record) {
  try {
    return order_work_from_record(record);
  } catch (const Error&) {
    return std::nullopt;
  }
}

OrderRecord record_of(const Rows& row) {
  OrderRecord record;
  record.owner = row.text(0);
  auto order = readable_order(row.text(1), row.text(3));
  auto work = readable_work(row.text(2));
  if (order && !work) report_damaged("order", order->id);
  record.is_damaged = !order || !work;
  if (!record.is_damaged) {
    record.order = *std::move(order);
    record.work = *std::move(work);
    return record;
  }
  record.order.id = row.text(3);
  record.order.state = row.choice(4, OrderState::kCancelled);
  if (!row.text(5).empty()) record.order.rule = row.text(5);
  record.order.created = timestamp_of(from_us(row.integer(6)));
  record.work.begun = record.order.created;
  return record;
}

// Empty if the viewer sees no such order.
std::optional<OrderRecord> find(SqlConnection& connection, const Viewer& viewer,
                                const std::string& id, const char* lock = "") {
  Rows row = connection.query(
      std::string(kColumns) + "WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)" + lock, id, viewer);
  if (!row.next()) return std::nullopt;
  return record_of(row);
}

OrderRecord found(SqlConnection& connection, const Viewer& viewer, const std::string& id,
                  const char* lock = "") {
  if (auto record = find(connection, viewer, id, lock)) return *std::move(record);
  throw Error(ErrorCode::kNotFound, "there is no order with this id");
}

OrderRecord intact(OrderRecord record) {
  if (record.is_damaged) throw_damaged_order();
  return record;
}

std::size_t count_open(SqlConnection& connection) {
  Rows row = connection.query("SELECT count(*) FROM orders WHERE state < 4");
  row.next();
  return row.count(0);
}

// True if the order was stored by an earlier attempt of this transaction.
bool is_made(const SqlTransaction& transaction, const OrderSpec& spec) {
  return transaction.is_again() &&
         transaction->query("SELECT 1 FROM orders WHERE id = ?1", spec.record.order.id).next();
}

void insert(SqlConnection& connection, const OrderSpec& spec) {
  const Order& order = spec.record.order;
  const std::optional<std::string> key =
      spec.idempotency_key.empty() ? std::nullopt : std::optional(spec.idempotency_key);
  connection.run(
      "INSERT INTO orders(id, owner, state, rule, created, next, idempotency_key, request_digest, "
      "record, work) VALUES(?1, ?2, ?3, ?4, ?5, isomesh_now(), ?6, ?7, ?8, ?9)",
      order.id, spec.record.owner, order.state, order.rule, us_of_timestamp(order.created), key,
      spec.request_digest, to_record(order), to_record(spec.record.work));
}

// The result of an earlier submission with the same key.
std::optional<OrderSubmission> made_before(SqlConnection& connection, const OrderSpec& spec) {
  using Kind = OrderSubmission::Kind;
  if (spec.idempotency_key.empty()) return std::nullopt;
  Rows known = connection.query(
      "SELECT record, request_digest, id FROM orders WHERE owner = ?1 AND idempotency_key = ?2",
      spec.record.owner, spec.idempotency_key);
  if (!known.next()) return std::nullopt;
  if (known.text(1) != spec.request_digest) {
    return OrderSubmission{.kind = Kind::kConflict, .order = {}};
  }
  auto order = readable_order(known.text(0), known.text(2));
  if (!order) throw_damaged_order();
  return OrderSubmission{.kind = Kind::kExisting, .order = *std::move(order)};
}

std::optional<LastOrder> last_of(SqlConnection& connection, const WatchedSeries& series) {
  Rows row = connection.query(
      "SELECT w.instances, o.state, o.record, o.id, o.work FROM watched w LEFT JOIN orders o ON "
      "o.id = "
      "w.\"order\" WHERE w.rule = ?1 AND w.study = ?2 AND w.series = ?3",
      series.rule, series.study, series.series);
  if (!row.next()) return std::nullopt;
  LastOrder last = {.instances = static_cast<std::uint32_t>(row.integer(0))};
  if (row.is_null(1)) return last;
  last.state = row.choice(1, OrderState::kCancelled);
  if (!is_final(*last.state)) return last;
  last.order = readable_order(row.text(2), row.text(3));
  if (auto work = readable_work(row.text(4))) last.contents = std::move(work->contents);
  return last;
}

void insert_watched(SqlConnection& connection, const OrderSpec& spec, const WatchedSeries& series) {
  insert(connection, spec);
  connection.run(
      "INSERT INTO watched(rule, study, series, \"order\", instances, seen) VALUES(?1, ?2, ?3, ?4, "
      "?5, isomesh_kept(isomesh_now())) ON CONFLICT(rule, study, series) DO UPDATE SET \"order\" = "
      "excluded.\"order\", instances = excluded.instances, seen = excluded.seen",
      series.rule, series.study, series.series, spec.record.order.id, series.instances.value_or(0));
}

std::vector<std::string> named_blobs(SqlConnection& connection, const std::string& id) {
  Rows rows = connection.query("SELECT blob FROM order_blobs WHERE \"order\" = ?1", id);
  std::vector<std::string> blobs;
  while (rows.next()) blobs.push_back(rows.text(0));
  return blobs;
}

void name_blobs(SqlConnection& connection, const OrderRecord& record) {
  connection.run("DELETE FROM order_blobs WHERE \"order\" = ?1", record.order.id);
  if (is_final(record.order.state)) return;
  for (const std::string& blob :
       std::set<std::string>(record.work.blobs.begin(), record.work.blobs.end())) {
    connection.run("INSERT INTO order_blobs VALUES(?1, ?2)", record.order.id, blob);
  }
}

// Updates the record of an existing order, which is due at `next`, or now if that is empty.
void write(SqlConnection& connection, const OrderRecord& record,
           std::optional<std::int64_t> next = {}) {
  const Order& order = record.order;
  const std::optional<std::int64_t> finished =
      order.finished ? std::optional(us_of_timestamp(*order.finished)) : std::nullopt;
  connection.run(
      "UPDATE orders SET state = ?1, finished = CASE WHEN ?2 IS NULL THEN NULL ELSE "
      "isomesh_kept(?2) END, next = coalesce(?3, isomesh_now()), record = ?4, work = ?5 WHERE id = "
      "?6",
      order.state, finished, next, to_record(order), to_record(record.work), order.id);
  name_blobs(connection, record);
}

// Adds the order's callback, and records the final number of instances for its watched series.
void tell_of_end(SqlConnection& connection, const OrderRecord& record) {
  const Order& order = record.order;
  if (record.work.callback) {
    add_callback(connection, order.id, *record.work.callback, to_callback_json(order));
  }
  if (order.source.instances) {
    connection.run("UPDATE watched SET instances = ?1 WHERE \"order\" = ?2",
                   *order.source.instances, order.id);
  }
}

}  // namespace

OrderSubmission OrderStore::submit(const OrderSpec& spec, std::size_t most_open) {
  using Kind = OrderSubmission::Kind;
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) -> OrderSubmission {
    transaction->lock_table(kOrders);
    if (is_made(transaction, spec)) return {.kind = Kind::kNew, .order = spec.record.order};
    if (auto before = made_before(transaction.connection(), spec)) return *std::move(before);
    if (count_open(transaction.connection()) >= most_open) {
      return {.kind = Kind::kBusy, .order = {}};
    }
    insert(transaction.connection(), spec);
    transaction.commit();
    return {.kind = Kind::kNew, .order = spec.record.order};
  });
}

bool OrderStore::submit_watched(const OrderSpec& spec, const WatchedSeries& series,
                                std::size_t most_open) {
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    connection.lock_table(kOrders);
    if (is_made(transaction, spec)) return true;
    const auto before = last_of(connection, series);
    if ((before && is_done(*before, series)) || count_open(connection) >= most_open) return false;
    insert_watched(connection, spec, series);
    transaction.commit();
    return true;
  });
}

ReceivedFate OrderStore::submit_received(const OrderSpec& spec, const WatchedSeries& series,
                                         Time last, std::size_t most_open) {
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    connection.lock_table(kOrders);
    if (is_made(transaction, spec)) return ReceivedFate::kNew;
    const auto before = last_of(connection, series);
    const ReceivedFate fate = before ? fate_of(*before, series, last) : ReceivedFate::kNew;
    if (fate != ReceivedFate::kNew) return fate;
    if (count_open(connection) >= most_open) return ReceivedFate::kOpen;
    insert_watched(connection, spec, series);
    transaction.commit();
    return fate;
  });
}

Order OrderStore::get(const Viewer& viewer, const std::string& id) const {
  return database_.read(
      [&](SqlConnection& connection) { return intact(found(connection, viewer, id)).order; });
}

std::vector<Order> OrderStore::list(const Viewer& viewer, const OrderFilter& filter,
                                    const std::string& after, std::size_t limit) const {
  return list_despite_damage([&] { return list_after(viewer, filter, after, limit); },
                             [&] { return undamaged_after(viewer, filter, after, limit); });
}

std::vector<Order> OrderStore::list_after(const Viewer& viewer, const OrderFilter& filter,
                                          const std::string& after, std::size_t limit) const {
  std::vector<Order> orders;
  std::string last = after;
  // Repeats only if damaged records were skipped, because fewer than `limit` orders mean the end of
  // the list.
  for (bool is_over = false; !is_over && orders.size() < limit;) {
    std::size_t left = std::min<std::size_t>(limit - orders.size(), 1 << 30);
    Rows rows = database_.query(
        std::string("SELECT record, id FROM orders WHERE ") +
            (viewer ? "owner = ?1" : "?1 IS NULL") +
            " AND (?2 IS NULL OR state = ?2) AND (?3 IS NULL OR rule = ?3)" +
            (last.empty() ? " AND ?4 = ''" : " AND id < ?4") + " ORDER BY id DESC LIMIT ?5",
        viewer, filter.state, filter.rule, last, left);
    for (; rows.next(); --left) {
      last = rows.text(1);
      if (auto order = readable_order(rows.text(0), last)) orders.push_back(*std::move(order));
    }
    is_over = left > 0;
  }
  return orders;
}

std::vector<Order> OrderStore::undamaged_after(const Viewer& viewer, const OrderFilter& filter,
                                               const std::string& after, std::size_t limit) const {
  std::map<std::string, Order> found;
  const auto take = [&](const Rows& rows) {
    const std::string id = rows.text(1);
    auto order = readable_order(rows.text(0), id);
    if (order) found.emplace(id, *std::move(order));
    if (found.size() > limit) found.erase(found.begin());
  };
  read_undamaged(database_, kOrderTable,
                 "SELECT record, id FROM orders WHERE (?1 IS NULL OR owner = ?1) AND (?2 IS NULL "
                 "OR state = ?2) AND (?3 IS NULL OR rule = ?3) AND (?4 = '' OR id < ?4)",
                 take, viewer, filter.state, filter.rule, after);
  std::vector<Order> orders;
  for (auto& [id, order] : found) orders.push_back(std::move(order));
  std::ranges::reverse(orders);
  return orders;
}

std::vector<OrderRecord> OrderStore::due(Time now, std::size_t limit) const {
  const std::string query = std::string(kColumns) + "WHERE state < 4 AND (next <= ?1 OR next > ?2)";
  const std::int64_t now_us = database_.to_us(now);
  const std::int64_t longest_us = database_.to_us(now + kLongestWait);
  return list_despite_damage(
      [&] {
        Rows rows = database_.query(query + " ORDER BY next LIMIT ?3", now_us, longest_us, limit);
        std::vector<OrderRecord> records;
        while (rows.next()) records.push_back(record_of(rows));
        return records;
      },
      [&] {
        std::map<std::string, OrderRecord> found;
        const auto take = [&](const Rows& rows) {
          if (found.size() < limit) found.emplace(rows.text(3), record_of(rows));
        };
        read_undamaged(database_, kOrderTable, query, take, now_us, longest_us);
        std::vector<OrderRecord> records;
        for (auto& [id, record] : found) records.push_back(std::move(record));
        return records;
      });
}

std::optional<OrderRecord> OrderStore::if_due(const std::string& id, Time now) const {
  Rows rows = database_.query(
      std::string(kColumns) + "WHERE id = ?1 AND state < 4 AND (next <= ?2 OR next > ?3)", id,
      database_.to_us(now), database_.to_us(now + kLongestWait));
  if (!rows.next()) return std::nullopt;
  return record_of(rows);
}

std::optional<Time> OrderStore::next_after(Time now) const {
  Rows row = database_.query("SELECT min(next) FROM orders WHERE state < 4 AND next > ?1",
                             database_.to_us(now));
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.from_us(row.integer(0));
}

bool OrderStore::save(const OrderRecord& record, Time next) {
  return database_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    if (!is_ours_(connection)) return false;
    const auto known = find(connection, std::nullopt, record.order.id, connection.for_update());
    if (!known) return false;
    if (is_final(known->order.state)) {
      return transaction.is_again() && known->order == record.order;
    }
    // It was cancelled meanwhile.
    const auto& workitem = known->work.workitem;
    if (workitem && workitem->ending && record.work.workitem &&
        workitem->ending != record.work.workitem->ending) {
      return false;
    }
    write(connection, record, database_.to_us(next));
    if (is_final(record.order.state)) tell_of_end(connection, record);
    transaction.commit();
    return true;
  });
}

std::vector<std::string> OrderStore::blobs(const std::string& id) const {
  return database_.read([&](SqlConnection& connection) { return named_blobs(connection, id); });
}

void OrderStore::hurry(const std::string& id) {
  database_.run(Change::kRepeatable,
                "UPDATE orders SET next = isomesh_now() WHERE id = ?1 AND state < 4 "
                "AND next > isomesh_now()",
                id);
}

CancelledOrder OrderStore::cancel(const Viewer& viewer, const std::string& id) {
  return database_.change(Change::kNeeded, [&](SqlTransaction& transaction) -> CancelledOrder {
    SqlConnection& connection = transaction.connection();
    OrderRecord record = found(connection, viewer, id, connection.for_update());
    // The first attempt of this transaction may have cancelled it.
    if (is_final(record.order.state) && !record.is_damaged) {
      return {.order = record.order, .blobs = record.work.blobs};
    }
    if (end_at_worklist(record, OrderState::kCancelled)) {
      write(connection, record);
      transaction.commit();
      return {.order = record.order, .blobs = {}};
    }
    const std::vector<std::string> blobs = named_blobs(connection, id);
    cancel_order(record);
    write(connection, record);
    tell_of_end(connection, record);
    transaction.commit();
    return {.order = record.order, .blobs = blobs};
  });
}

Order OrderStore::retry(const Viewer& viewer, const std::string& id) {
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    OrderRecord record = intact(found(connection, viewer, id, connection.for_update()));
    if (transaction.is_again() && !is_final(record.order.state)) return record.order;
    begin_anew(record);
    write(connection, record);
    transaction.commit();
    return record.order;
  });
}

OrderCounts OrderStore::counts() const {
  return database_.read([](SqlConnection& connection) {
    OrderCounts counts;
    Rows rows =
        connection.query("SELECT state, coalesce(rule, ''), count(*) FROM orders GROUP BY 1, 2");
    while (rows.next()) {
      counts.by_state_and_rule[{rows.choice(0, OrderState::kCancelled), rows.text(1)}] +=
          rows.count(2);
    }
    Rows oldest = connection.query("SELECT min(created) FROM orders WHERE state < 4");
    oldest.next();
    if (!oldest.is_null(0)) counts.oldest_open = from_us(oldest.integer(0));
    return counts;
  });
}

std::size_t OrderStore::forget(Time before, Time watched) {
  return database_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    // Orders record their end by the clock of the process that carried them out.
    const std::size_t removed =
        transaction->run("DELETE FROM orders WHERE finished < ?1", to_us(before));
    transaction->run("DELETE FROM watched WHERE seen < ?1", database_.to_us(watched));
    transaction.commit();
    return removed;
  });
}

}  // namespace isomesh::store
