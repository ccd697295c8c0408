#include "server/store/sqlite/order_store.h"

#include <set>

#include "base/clock.h"
#include "proto/error.h"
#include "server/store/order_rules.h"
#include "server/store/sqlite/outbox.h"

namespace isomesh::store {
namespace {

OrderRecord record_of(const Query& row) {
  return {.owner = row.text(0),
          .order = order_from_record(row.text(1)),
          .work = order_work_from_record(row.text(2))};
}

// Empty when the viewer sees none.
std::optional<OrderRecord> find(Connection& connection, const Viewer& viewer,
                                const std::string& id) {
  Query row = connection.query(
      "SELECT owner, record, work FROM orders WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id,
      viewer);
  if (!row.next()) return std::nullopt;
  return record_of(row);
}

OrderRecord found(Connection& connection, const Viewer& viewer, const std::string& id) {
  if (auto record = find(connection, viewer, id)) return *std::move(record);
  throw Error(ErrorCode::kNotFound, "there is no order with this id");
}

std::size_t count_open(Connection& connection) {
  Query query = connection.query("SELECT count(*) FROM orders WHERE state < 4");
  query.next();
  return static_cast<std::size_t>(query.integer(0));
}

void insert(Connection& connection, const OrderSpec& spec) {
  const auto& [owner, order, work] = spec.record;
  const std::optional<std::string> key =
      spec.idempotency_key.empty() ? std::nullopt : std::optional(spec.idempotency_key);
  connection.run("INSERT INTO orders VALUES(?, ?, ?, ?, ?, NULL, ?, ?, ?, ?, ?)", order.id, owner,
                 order.state, order.rule, us_of_timestamp(order.created), now_us(), key,
                 spec.request_digest, to_json(order), to_record(work));
}

std::optional<LastOrder> last_of(Connection& connection, const WatchedSeries& series) {
  Query row = connection.query(
      "SELECT w.instances, o.state, o.record FROM watched w LEFT JOIN orders o ON o.id = "
      "w.\"order\" WHERE w.rule = ? AND w.study = ? AND w.series = ?",
      series.rule, series.study, series.series);
  if (!row.next()) return std::nullopt;
  LastOrder last = {.instances = static_cast<std::uint32_t>(row.integer(0))};
  if (row.is_null(1)) return last;
  last.state = static_cast<OrderState>(row.integer(1));
  last.record = row.text(2);
  return last;
}

void insert_watched(Connection& connection, const OrderSpec& spec, const WatchedSeries& series) {
  insert(connection, spec);
  connection.run("INSERT OR REPLACE INTO watched VALUES(?, ?, ?, ?, ?, ?)", series.rule,
                 series.study, series.series, spec.record.order.id, series.instances, now_us());
}

void name_blobs(Connection& connection, const OrderRecord& record) {
  connection.run("DELETE FROM order_blobs WHERE \"order\" = ?", record.order.id);
  if (is_final(record.order.state)) return;
  for (const std::string& blob :
       std::set<std::string>(record.work.blobs.begin(), record.work.blobs.end())) {
    connection.run("INSERT INTO order_blobs VALUES(?, ?)", record.order.id, blob);
  }
}

// Who has ended is told of, and the series is known by what it was in the end.
void tell_of_end(Connection& connection, const OrderRecord& record) {
  const Order& order = record.order;
  if (record.work.callback) {
    SqliteOutbox::add(connection, order.id, *record.work.callback, to_callback_json(order));
  }
  if (order.source.instances) {
    connection.run("UPDATE watched SET instances = ? WHERE \"order\" = ?", *order.source.instances,
                   order.id);
  }
}

}  // namespace

OrderSubmission SqliteOrderStore::submit(const OrderSpec& spec, std::size_t most_open) {
  using Kind = OrderSubmission::Kind;
  Transaction transaction(database_.writer());
  if (!spec.idempotency_key.empty()) {
    Query known = transaction->query(
        "SELECT record, request_digest FROM orders WHERE owner = ? AND idempotency_key = ?",
        spec.record.owner, spec.idempotency_key);
    if (known.next()) {
      if (known.text(1) != spec.request_digest) return {.kind = Kind::kConflict, .order = {}};
      return {.kind = Kind::kExisting, .order = order_from_record(known.text(0))};
    }
  }
  if (count_open(transaction.connection()) >= most_open) return {.kind = Kind::kBusy, .order = {}};
  insert(transaction.connection(), spec);
  transaction.commit();
  return {.kind = Kind::kNew, .order = spec.record.order};
}

bool SqliteOrderStore::submit_watched(const OrderSpec& spec, const WatchedSeries& series,
                                      std::size_t most_open) {
  Transaction transaction(database_.writer());
  Connection& connection = transaction.connection();
  const auto before = last_of(connection, series);
  if ((before && is_done(*before, series)) || count_open(connection) >= most_open) return false;
  insert_watched(connection, spec, series);
  transaction.commit();
  return true;
}

ReceivedFate SqliteOrderStore::submit_received(const OrderSpec& spec, const WatchedSeries& series,
                                               Time last, std::size_t most_open) {
  Transaction transaction(database_.writer());
  Connection& connection = transaction.connection();
  const auto before = last_of(connection, series);
  const ReceivedFate fate = before ? fate_of(*before, series, last) : ReceivedFate::kNew;
  if (fate != ReceivedFate::kNew) return fate;
  if (count_open(connection) >= most_open) return ReceivedFate::kOpen;
  insert_watched(connection, spec, series);
  transaction.commit();
  return fate;
}

Order SqliteOrderStore::get(const Viewer& viewer, const std::string& id) const {
  const Reading reading(database_.reader());
  return found(reading.connection(), viewer, id).order;
}

std::vector<Order> SqliteOrderStore::list(const Viewer& viewer, const OrderFilter& filter,
                                          const std::string& after, std::size_t limit) const {
  std::vector<std::string> records;
  {
    const Reading reading(database_.reader());
    const std::string sql =
        std::string("SELECT record FROM orders WHERE ") + (viewer ? "owner = ?1" : "?1 IS NULL") +
        " AND (?2 IS NULL OR state = ?2) AND (?3 IS NULL OR rule = ?3)" +
        (after.empty() ? " AND ?4 = ''" : " AND id < ?4") + " ORDER BY id DESC LIMIT ?5";
    Query query = reading->query(sql, viewer, filter.state, filter.rule, after, limit);
    while (query.next()) records.push_back(query.text(0));
  }
  std::vector<Order> orders;
  for (const std::string& record : records) orders.push_back(order_from_record(record));
  return orders;
}

std::vector<OrderRecord> SqliteOrderStore::due(Time now, std::size_t limit) const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT owner, record, work FROM orders WHERE state < 4 AND next <= ? ORDER BY next LIMIT ?",
      to_us(now), limit);
  std::vector<OrderRecord> records;
  while (query.next()) records.push_back(record_of(query));
  return records;
}

std::optional<OrderRecord> SqliteOrderStore::if_due(const std::string& id, Time now) const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT owner, record, work FROM orders WHERE id = ? AND state < 4 AND next <= ?", id,
      to_us(now));
  if (!query.next()) return std::nullopt;
  return record_of(query);
}

std::optional<Time> SqliteOrderStore::next_after(Time now) const {
  const Reading reading(database_.reader());
  Query row =
      reading->query("SELECT min(next) FROM orders WHERE state < 4 AND next > ?", to_us(now));
  if (!row.next() || row.is_null(0)) return std::nullopt;
  return from_us(row.integer(0));
}

void SqliteOrderStore::write(Connection& connection, const OrderRecord& record, std::int64_t next) {
  const Order& order = record.order;
  const std::optional<std::int64_t> finished =
      order.finished ? std::optional(us_of_timestamp(*order.finished)) : std::nullopt;
  connection.run(
      "UPDATE orders SET state = ?, finished = ?, next = ?, record = ?, work = ? WHERE id = ?",
      order.state, finished, next, to_json(order), to_record(record.work), order.id);
  name_blobs(connection, record);
}

bool SqliteOrderStore::save(const OrderRecord& record, Time next) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    const auto known = find(transaction.connection(), std::nullopt, record.order.id);
    if (!known || is_final(known->order.state)) return false;
    write(transaction.connection(), record, to_us(next));
    if (is_final(record.order.state)) tell_of_end(transaction.connection(), record);
    transaction.commit();
    return true;
  });
}

void SqliteOrderStore::hurry(const std::string& id) {
  Transaction transaction(database_.writer(), Durability::kProcess);
  transaction->run("UPDATE orders SET next = min(next, ?) WHERE id = ? AND state < 4", now_us(),
                   id);
  transaction.commit();
}

Order SqliteOrderStore::cancel(const Viewer& viewer, const std::string& id) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    OrderRecord record = found(transaction.connection(), viewer, id);
    if (is_final(record.order.state)) return record.order;
    cancel_order(record);
    write(transaction.connection(), record, now_us());
    tell_of_end(transaction.connection(), record);
    transaction.commit();
    return record.order;
  });
}

Order SqliteOrderStore::retry(const Viewer& viewer, const std::string& id) {
  Transaction transaction(database_.writer());
  OrderRecord record = found(transaction.connection(), viewer, id);
  begin_anew(record);
  write(transaction.connection(), record, now_us());
  transaction.commit();
  return record.order;
}

OrderCounts SqliteOrderStore::counts() const {
  const Reading reading(database_.reader());
  OrderCounts counts;
  Query rows =
      reading->query("SELECT state, coalesce(rule, ''), count(*) FROM orders GROUP BY 1, 2");
  while (rows.next()) {
    counts.by_state_and_rule[{static_cast<OrderState>(rows.integer(0)), rows.text(1)}] =
        static_cast<std::uint64_t>(rows.integer(2));
  }
  Query oldest = reading->query("SELECT min(created) FROM orders WHERE state < 4");
  if (oldest.next() && !oldest.is_null(0)) counts.oldest_open = from_us(oldest.integer(0));
  return counts;
}

std::size_t SqliteOrderStore::forget(Time before) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    const int removed = transaction->run("DELETE FROM orders WHERE finished < ?", to_us(before));
    // A series that is not in the time that watches look at any more.
    constexpr std::chrono::days kWatched{90};
    transaction->run("DELETE FROM watched WHERE seen < ?", to_us(before - kWatched));
    transaction.commit();
    return static_cast<std::size_t>(removed);
  });
}

}  // namespace isomesh::store
