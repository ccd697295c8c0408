// Shared code for the expiry of jobs and of volumes. For stores only.
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

// From rows of owner, id and time of last use.
std::vector<Expirable> read_expirable(const SqlDatabase& database, RecordKind kind, Rows rows);

// From rows of key and bytes.
std::vector<Blob> read_blobs(Rows rows);

// Erases ended jobs, with their undelivered callbacks and all of their events but the end, for
// good: their ids are not remembered. The caller has locked their rows.
void erase_jobs(SqlConnection& connection, std::span<const std::string> jobs,
                const BlobsGoing& going);

// Deletes the events of a job whose record goes. Its end stays until all events of that time go:
// processes that share the records may not have read it yet, and their clients wait for it.
void delete_events_before_end(SqlConnection& connection, const std::string& job);

// Total size of the blobs that column `key` of the table names; each counts once.
std::uint64_t sum_of_blobs(SqlDatabase& database, const std::string& table, const std::string& key);

// From rows of owner and sum of bytes.
OwnedBytes read_owned_bytes(Rows rows);

// True if a job or volume with that id, visible to the viewer, has expired.
bool has_expired(SqlConnection& connection, const std::optional<std::string>& viewer,
                 const std::string& id);

// Removes records in the given order until that frees `enough` bytes. `remove` removes one and
// returns the blobs that it named; empty if the record does not expire.
using Remove =
    std::function<std::optional<std::vector<Blob>>(SqlConnection& connection, const Expirable&)>;
Expired expire_records(SqlDatabase& database, std::span<const Expirable> records,
                       std::uint64_t enough, const Remove& remove);

}  // namespace isomesh::store
