// What the expiry of jobs and that of volumes share. Private to this folder.
#pragma once

#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/sqlite/sqlite.h"

namespace isomesh::store {

// The rows of a query for keys and bytes.
std::vector<Blob> read_blobs(Query&& query);

// Of rows that are an owner and a sum of bytes.
OwnedBytes read_owned_bytes(Query&& query);

// Whether any record, of a volume or of a mesh, names the blob.
bool is_named(Connection& connection, const std::string& blob);

// Adds those blobs that no record names.
void add_unnamed(Connection& connection, const std::vector<Blob>& blobs, Expired& expired);

// From now on the id is known as one that has expired.
void remember_expired(Connection& connection, const Expirable& item);

}  // namespace isomesh::store
