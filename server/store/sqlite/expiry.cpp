#include "server/store/sqlite/expiry.h"

#include "server/store/sqlite/database.h"

namespace isomesh::store {

std::vector<Blob> read_blobs(Query&& query) {
  std::vector<Blob> blobs;
  while (query.next()) {
    blobs.push_back({query.text(0), static_cast<std::uint64_t>(query.integer(1))});
  }
  return blobs;
}

OwnedBytes read_owned_bytes(Query&& query) {
  OwnedBytes bytes;
  while (query.next()) bytes[query.text(0)] = static_cast<std::uint64_t>(query.integer(1));
  return bytes;
}

bool is_named(Connection& connection, const std::string& blob) {
  Query query = connection.query(
      "SELECT EXISTS(SELECT 1 FROM volumes WHERE id = ?1) OR EXISTS(SELECT 1 FROM meshes WHERE "
      "blob = ?1) OR EXISTS(SELECT 1 FROM order_blobs WHERE blob = ?1) OR EXISTS(SELECT 1 FROM "
      "received WHERE blob = ?1)",
      blob);
  query.next();
  return query.integer(0) != 0;
}

void add_unnamed(Connection& connection, const std::vector<Blob>& blobs, Expired& expired) {
  for (const Blob& blob : blobs) {
    if (is_named(connection, blob.key)) continue;
    expired.bytes += blob.bytes;
    expired.blobs.push_back(blob.key);
  }
}

void remember_expired(Connection& connection, const Expirable& item) {
  connection.run("INSERT OR REPLACE INTO expired VALUES(?, ?, ?)", item.id, item.owner, now_us());
}

}  // namespace isomesh::store
