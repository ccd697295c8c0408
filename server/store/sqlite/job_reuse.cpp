// Meshes that serve more than one job, and those that are made again.
#include "proto/json.h"
#include "server/store/sqlite/job_rows.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store {
namespace {

std::optional<std::vector<Note>> notes_of(Connection& connection, const std::string& owner,
                                          const std::string& volume) {
  Query query = connection.query(
      "SELECT coalesce(json_extract(record, '$.notes'), '[]') FROM volumes WHERE owner = ? AND id "
      "= ?",
      owner, volume);
  if (!query.next()) return std::nullopt;
  return notes_from_json(query.text(0));
}

}  // namespace

std::optional<std::string> SqliteJobStore::result_key_of(Connection& connection,
                                                         const JobSpec& spec) const {
  const auto notes = notes_of(connection, spec.owner, spec.parameters.volume);
  if (!notes) return std::nullopt;
  return result_key(spec.parameters.volume, *notes, spec.parameters, options_.mesher_version);
}

Job SqliteJobStore::remake(const std::string& id) {
  JobSpec spec;
  {
    const Reading reading(database_.reader());
    const Row row = found(reading.connection(), std::nullopt, id);
    spec.owner = row.owner;
    spec.parameters = row.job.parameters;
    spec.parameters.callback.reset();
    const auto key = result_key_of(reading.connection(), spec);
    if (key && row.result_key != *key) throw_other_version();
    Query query = reading->query(std::string("SELECT ") + kRowColumns +
                                     " FROM jobs WHERE owner = ? AND result_key = ? AND id > ? "
                                     "ORDER BY id DESC LIMIT 1",
                                 row.owner, row.result_key, id);
    if (query.next()) {
      const Row youngest = row_of(query);
      if (!is_final(youngest.job.state) || youngest.job.error) return with_progress(youngest);
    }
  }
  try {
    return job_of(submit(spec));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    throw_volume_gone();
  }
}

std::optional<MeshSummary> SqliteJobStore::mesh_like(
    Connection& connection, const Row& row, const std::optional<MeshSummary>& spoilt) const {
  Query query = connection.query(
      "SELECT record FROM jobs WHERE owner = ? AND result_key = ? AND state = 2 ORDER BY id DESC "
      "LIMIT 1",
      row.owner, row.result_key);
  if (!query.next()) return std::nullopt;
  auto mesh = job_from_record(query.text(0)).mesh;
  const bool is_spoilt = mesh && spoilt && have_same_blobs(*mesh, *spoilt);
  return mesh && is_there(*mesh, blobs_) && !is_spoilt ? std::move(mesh) : std::nullopt;
}

std::optional<MeshSummary> SqliteJobStore::spoilt_mesh_for(const JobSpec& spec) const {
  std::optional<MeshSummary> mesh;
  {
    const Reading reading(database_.reader());
    const auto key = result_key_of(reading.connection(), spec);
    if (!key) return std::nullopt;
    Row row;
    row.owner = spec.owner;
    row.result_key = *key;
    mesh = mesh_like(reading.connection(), row, std::nullopt);
  }
  return !mesh || is_intact(*mesh, blobs_) ? std::nullopt : std::move(mesh);
}

}  // namespace isomesh::store
