#include "server/store/postgresql/order_store.h"

#include <set>

#include "proto/error.h"
#include "server/store/microseconds.h"
#include "server/store/order_rules.h"
#include "server/store/outbox.h"

namespace isomesh::store::postgresql {
namespace {

constexpr const char* kToChange = " FOR UPDATE";

OrderRecord record_of(const Rows& row) {
  return {.owner = row.text(0),
          .order = order_from_record(row.text(1)),
          .work = order_work_from_record(row.text(2))};
}

// Empty when the viewer sees none.
std::optional<OrderRecord> find(Connection& connection, const Viewer& viewer, const std::string& id,
                                const char* lock = "") {
  Rows row = connection.run(
      std::string("SELECT owner, record, work FROM orders WHERE id = $1::text AND ($2::text IS "
                  "NULL OR owner = $2::text)") +
          lock,
      id, viewer);
  if (!row.next()) return std::nullopt;
  return record_of(row);
}

OrderRecord found(Connection& connection, const Viewer& viewer, const std::string& id,
                  const char* lock = "") {
  if (auto record = find(connection, viewer, id, lock)) return *std::move(record);
  throw Error(ErrorCode::kNotFound, "there is no order with this id");
}

// Until the transaction ends nobody else makes an order.
void lock_orders(Connection& connection) {
  connection.run(
      "SELECT pg_advisory_xact_lock(hashtext('isomesh orders'), hashtext(current_schema()))");
}

std::size_t count_open(Connection& connection) {
  Rows row = connection.run("SELECT count(*) FROM orders WHERE state < 4");
  row.next();
  return static_cast<std::size_t>(row.integer(0));
}

bool is_there(Connection& connection, const OrderSpec& spec) {
  return connection.run("SELECT 1 FROM orders WHERE id = $1::text", spec.record.order.id).next();
}

void insert(Connection& connection, const OrderSpec& spec) {
  const auto& [owner, order, work] = spec.record;
  const std::optional<std::string> key =
      spec.idempotency_key.empty() ? std::nullopt : std::optional(spec.idempotency_key);
  connection.run(
      "INSERT INTO orders VALUES($1::text, $2::text, $3::int, $4::text, $5::bigint, NULL, "
      "isomesh_now(), $6::text, $7::text, $8::text, $9::text)",
      order.id, owner, order.state, order.rule, us_of_timestamp(order.created), key,
      spec.request_digest, to_json(order), to_record(work));
}

std::optional<LastOrder> last_of(Connection& connection, const WatchedSeries& series) {
  Rows row = connection.run(
      "SELECT w.instances, o.state, o.record FROM watched w LEFT JOIN orders o ON o.id = "
      "w.\"order\" WHERE w.rule = $1::text AND w.study = $2::text AND w.series = $3::text",
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
  connection.run(
      "INSERT INTO watched VALUES($1::text, $2::text, $3::text, $4::text, $5::bigint, "
      "isomesh_now()) ON CONFLICT(rule, study, series) DO UPDATE SET \"order\" = "
      "excluded.\"order\", instances = excluded.instances, seen = excluded.seen",
      series.rule, series.study, series.series, spec.record.order.id, series.instances);
}

void name_blobs(Connection& connection, const OrderRecord& record) {
  connection.run("DELETE FROM order_blobs WHERE \"order\" = $1::text", record.order.id);
  if (is_final(record.order.state) || record.work.blobs.empty()) return;
  const std::set<std::string> each(record.work.blobs.begin(), record.work.blobs.end());
  connection.run("INSERT INTO order_blobs SELECT $1::text, unnest($2::text[])", record.order.id,
                 std::vector<std::string>(each.begin(), each.end()));
}

// Who has ended is told of, and the series is known by what it was in the end.
void tell_of_end(Connection& connection, const OrderRecord& record) {
  const Order& order = record.order;
  if (const auto& url = record.work.callback) {
    connection.run(
        "INSERT INTO callbacks(job, receiver, url, body, attempts, created, next) VALUES($1::text, "
        "$2::text, $3::text, $4::text, 0, isomesh_now(), isomesh_now()) ON CONFLICT(job) DO UPDATE "
        "SET body = excluded.body, attempts = 0, created = excluded.created, next = excluded.next",
        order.id, receiver_of(*url), *url, to_callback_json(order));
  }
  if (order.source.instances) {
    connection.run("UPDATE watched SET instances = $1::bigint WHERE \"order\" = $2::text",
                   *order.source.instances, order.id);
  }
}

}  // namespace

OrderSubmission PostgresOrderStore::submit(const OrderSpec& spec, std::size_t most_open) {
  using Kind = OrderSubmission::Kind;
  return database_.ask([&](Connection& connection, bool is_again) -> OrderSubmission {
    Transaction transaction(connection);
    lock_orders(connection);
    if (is_again && is_there(connection, spec)) {
      return {.kind = Kind::kNew, .order = spec.record.order};
    }
    if (!spec.idempotency_key.empty()) {
      Rows known = transaction->run(
          "SELECT record, request_digest FROM orders WHERE owner = $1::text AND idempotency_key = "
          "$2::text",
          spec.record.owner, spec.idempotency_key);
      if (known.next()) {
        if (known.text(1) != spec.request_digest) return {.kind = Kind::kConflict, .order = {}};
        return {.kind = Kind::kExisting, .order = order_from_record(known.text(0))};
      }
    }
    if (count_open(connection) >= most_open) return {.kind = Kind::kBusy, .order = {}};
    insert(connection, spec);
    transaction.commit();
    return {.kind = Kind::kNew, .order = spec.record.order};
  });
}

bool PostgresOrderStore::submit_watched(const OrderSpec& spec, const WatchedSeries& series,
                                        std::size_t most_open) {
  return database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    lock_orders(connection);
    if (is_again && is_there(connection, spec)) return true;
    const auto before = last_of(connection, series);
    if ((before && is_done(*before, series)) || count_open(connection) >= most_open) return false;
    insert_watched(connection, spec, series);
    transaction.commit();
    return true;
  });
}

ReceivedFate PostgresOrderStore::submit_received(const OrderSpec& spec, const WatchedSeries& series,
                                                 Time last, std::size_t most_open) {
  return database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    lock_orders(connection);
    if (is_again && is_there(connection, spec)) return ReceivedFate::kNew;
    const auto before = last_of(connection, series);
    const ReceivedFate fate = before ? fate_of(*before, series, last) : ReceivedFate::kNew;
    if (fate != ReceivedFate::kNew) return fate;
    if (count_open(connection) >= most_open) return ReceivedFate::kOpen;
    insert_watched(connection, spec, series);
    transaction.commit();
    return fate;
  });
}

Order PostgresOrderStore::get(const Viewer& viewer, const std::string& id) const {
  return database_.ask(
      [&](Connection& connection, bool) { return found(connection, viewer, id).order; });
}

std::vector<Order> PostgresOrderStore::list(const Viewer& viewer, const OrderFilter& filter,
                                            const std::string& after, std::size_t limit) const {
  Rows rows = database_.run(
      std::string("SELECT record FROM orders WHERE ") +
          (viewer ? "owner = $1::text" : "$1::text IS NULL") +
          " AND ($2::int IS NULL OR state = $2::int) AND ($3::text IS NULL OR rule = $3::text)" +
          (after.empty() ? " AND $4::text = ''" : " AND id < $4::text") +
          " ORDER BY id DESC LIMIT $5::bigint",
      viewer, filter.state, filter.rule, after, limit);
  std::vector<Order> orders;
  while (rows.next()) orders.push_back(order_from_record(rows.text(0)));
  return orders;
}

std::vector<OrderRecord> PostgresOrderStore::due(Time now, std::size_t limit) const {
  Rows rows = database_.run(
      "SELECT owner, record, work FROM orders WHERE state < 4 AND next <= $1::bigint ORDER BY next "
      "LIMIT $2::bigint",
      database_.to_us(now), limit);
  std::vector<OrderRecord> records;
  while (rows.next()) records.push_back(record_of(rows));
  return records;
}

std::optional<OrderRecord> PostgresOrderStore::if_due(const std::string& id, Time now) const {
  Rows rows = database_.run(
      "SELECT owner, record, work FROM orders WHERE id = $1::text AND state < 4 AND next <= "
      "$2::bigint",
      id, database_.to_us(now));
  if (!rows.next()) return std::nullopt;
  return record_of(rows);
}

std::optional<Time> PostgresOrderStore::next_after(Time now) const {
  Rows row = database_.run("SELECT min(next) FROM orders WHERE state < 4 AND next > $1::bigint",
                           database_.to_us(now));
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.from_us(row.integer(0));
}

void PostgresOrderStore::write(Connection& connection, const OrderRecord& record,
                               std::optional<Time> next) const {
  const Order& order = record.order;
  connection.run(
      "UPDATE orders SET state = $1::int, finished = $2::bigint, next = coalesce($3::bigint, "
      "isomesh_now()), record = $4::text, work = $5::text WHERE id = $6::text",
      order.state, order.finished ? std::optional(us_of_timestamp(*order.finished)) : std::nullopt,
      next ? std::optional(database_.to_us(*next)) : std::nullopt, to_json(order),
      to_record(record.work), order.id);
  name_blobs(connection, record);
}

bool PostgresOrderStore::save(const OrderRecord& record, Time next) {
  return database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    const auto known = find(connection, std::nullopt, record.order.id, kToChange);
    if (!known) return false;
    if (is_final(known->order.state)) return is_again && known->order == record.order;
    write(connection, record, next);
    if (is_final(record.order.state)) tell_of_end(connection, record);
    transaction.commit();
    return true;
  });
}

void PostgresOrderStore::hurry(const std::string& id) {
  database_.run(
      "UPDATE orders SET next = least(next, isomesh_now()) WHERE id = $1::text AND state < 4", id);
}

Order PostgresOrderStore::cancel(const Viewer& viewer, const std::string& id) {
  return database_.ask([&](Connection& connection, bool) {
    Transaction transaction(connection);
    OrderRecord record = found(connection, viewer, id, kToChange);
    if (is_final(record.order.state)) return record.order;
    cancel_order(record);
    write(connection, record, std::nullopt);
    tell_of_end(connection, record);
    transaction.commit();
    return record.order;
  });
}

Order PostgresOrderStore::retry(const Viewer& viewer, const std::string& id) {
  return database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    OrderRecord record = found(connection, viewer, id, kToChange);
    if (is_again && !is_final(record.order.state)) return record.order;
    begin_anew(record);
    write(connection, record, std::nullopt);
    transaction.commit();
    return record.order;
  });
}

OrderCounts PostgresOrderStore::counts() const {
  OrderCounts counts;
  Rows rows = database_.run("SELECT state, coalesce(rule, ''), count(*) FROM orders GROUP BY 1, 2");
  while (rows.next()) {
    counts.by_state_and_rule[{static_cast<OrderState>(rows.integer(0)), rows.text(1)}] =
        static_cast<std::uint64_t>(rows.integer(2));
  }
  Rows oldest = database_.run("SELECT min(created) FROM orders WHERE state < 4");
  oldest.next();
  if (!oldest.is_null(0)) {
    counts.oldest_open = store::from_us(oldest.integer(0));
  }
  return counts;
}

std::size_t PostgresOrderStore::forget(Time before) {
  // A series that is not in the time that watches look at any more.
  constexpr std::chrono::days kWatched{90};
  const std::size_t removed =
      database_.run("DELETE FROM orders WHERE finished < $1::bigint", store::to_us(before))
          .changed();
  database_.run("DELETE FROM watched WHERE seen < $1::bigint", database_.to_us(before - kWatched));
  return removed;
}

}  // namespace isomesh::store::postgresql
