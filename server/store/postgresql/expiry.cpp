#include "server/store/postgresql/expiry.h"

namespace isomesh::store::postgresql {

std::vector<Expirable> read_expirable(const Database& database, RecordKind kind, Rows rows) {
  std::vector<Expirable> items;
  while (rows.next()) {
    items.push_back({kind, rows.text(0), rows.text(1), database.from_us(rows.integer(2))});
  }
  return items;
}

OwnedBytes read_owned_bytes(Rows rows) {
  OwnedBytes bytes;
  while (rows.next()) bytes[rows.text(0)] = static_cast<std::uint64_t>(rows.integer(1));
  return bytes;
}

void add_expired(Rows rows, Expired& expired) {
  while (rows.next()) {
    if (rows.is_null(0)) {
      ++expired.records;
      continue;
    }
    expired.bytes += static_cast<std::uint64_t>(rows.integer(1));
    expired.blobs.push_back(rows.text(0));
  }
}

}  // namespace isomesh::store::postgresql
