#include "server/hospital/records/tables.h"

namespace isomesh::store {
namespace {

constexpr const char* kTables = R"sql(
CREATE TABLE orders(            -- states are the values of OrderState; those from 4 on are final
  id {key} NOT NULL PRIMARY KEY,
  owner {key} NOT NULL,
  state INTEGER NOT NULL,
  rule {key},
  created BIGINT NOT NULL,
  finished BIGINT,
  next BIGINT NOT NULL,         -- when it is due, while it is open
  idempotency_key {key},
  request_digest TEXT NOT NULL,
  record TEXT NOT NULL,         -- the JSON of the API
  work TEXT NOT NULL            -- what the API does not tell
){by_key};
CREATE INDEX orders_due ON orders(next) WHERE state < 4;
CREATE INDEX orders_by_owner ON orders(owner, id);
CREATE INDEX orders_by_end ON orders(finished) WHERE finished IS NOT NULL;
CREATE UNIQUE INDEX orders_by_key ON orders(owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

CREATE TABLE order_blobs(       -- objects that are about to be sent
  "order" {key} NOT NULL REFERENCES orders(id) ON DELETE CASCADE,
  blob {key} NOT NULL,
  PRIMARY KEY("order", blob)
){by_key};
CREATE INDEX order_blobs_by_blob ON order_blobs(blob);

CREATE TABLE watched(           -- series that rules have made orders of
  rule {key} NOT NULL,
  study {key} NOT NULL,
  series {key} NOT NULL,
  "order" {key} NOT NULL,       -- the last one
  instances BIGINT NOT NULL,    -- as many as there were for that
  seen BIGINT NOT NULL,
  PRIMARY KEY(rule, study, series)
){by_key};
CREATE INDEX watched_by_order ON watched("order");
CREATE INDEX watched_by_time ON watched(seen);

CREATE TABLE received(          -- instances that peers have sent; see ReceivedStore
  route {key} NOT NULL,
  study {key} NOT NULL,
  series {key} NOT NULL,
  instance {key} NOT NULL,
  blob {key},                   -- while it is held
  bytes BIGINT NOT NULL,
  at BIGINT NOT NULL,
  PRIMARY KEY(route, study, series, instance)
){by_key};
CREATE INDEX received_held ON received(route, study, series, at, bytes) WHERE blob IS NOT NULL;
CREATE INDEX received_by_blob ON received(blob) WHERE blob IS NOT NULL;
)sql";

constexpr const char* kWorkitems = R"sql(
CREATE TABLE workitems(         -- of the own worklist; states are the values of WorkitemState
  uid {key} NOT NULL PRIMARY KEY,
  state INTEGER NOT NULL,
  created BIGINT NOT NULL,
  changed BIGINT NOT NULL,
  "transaction" {key},          -- secret of the performer, once it is claimed
  bytes BIGINT NOT NULL,        -- of the record
  record TEXT NOT NULL          -- its attributes in the DICOM JSON Model
){by_key};
CREATE INDEX workitems_by_state ON workitems(state, created, uid);
CREATE INDEX workitems_by_time ON workitems(created, uid);
CREATE INDEX workitems_by_change ON workitems(changed);
)sql";

}  // namespace

Schema order_tables() {
  return {.component = "hospital",
          .steps = {kTables, kWorkitems},
          .tables = {"orders", "order_blobs", "watched", "received", "workitems"},
          .named_blobs =
              "SELECT blob, 'an object of the order ' AS what, \"order\" AS name FROM "
              "order_blobs UNION ALL SELECT blob, 'the received image ', instance FROM "
              "received",
          .kept_from = {{"orders", "finished"}, {"workitems", "changed"}}};
}

}  // namespace isomesh::store
