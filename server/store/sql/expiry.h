// What the expiry of jobs and that of volumes share. For stores only.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// Of rows that are an owner, an id and when it was used last.
std::vector<Expirable> read_expirable(const SqlDatabase& database, RecordKind kind, Rows rows);

// Of rows that are a key and bytes.
std::vector<Blob> read_blobs(Rows rows);

// Of rows that are an owner and a sum of bytes.
OwnedBytes read_owned_bytes(Rows rows);

// Whether any record, of a volume or of a mesh, names the blob.
bool is_named(SqlConnection& connection, const std::string& blob);

// Whether a job or a volume of that id was there that the viewer saw.
bool has_expired(SqlConnection& connection, const std::optional<std::string>& viewer,
                 const std::string& id);

// Removes records in their order until that frees `enough` bytes. `remove` removes one and returns
// the blobs that it named; empty when it does not expire.
using Remove =
    std::function<std::optional<std::vector<Blob>>(SqlConnection& connection, const Expirable&)>;
Expired expire_records(SqlDatabase& database, std::span<const Expirable> records,
                       std::uint64_t enough, const Remove& remove);

}  // namespace isomesh::store
