// Meshes that serve more than one job, and those that are made again.
#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/postgresql/job_rows.h"

namespace isomesh::store::postgresql {

std::optional<std::string> PostgresJobStore::result_key_of(const JobSpec& spec) const {
  Rows row = database_.run("SELECT record FROM volumes WHERE owner = $1::text AND id = $2::text",
                           spec.owner, spec.parameters.volume);
  if (!row.next()) return std::nullopt;
  return result_key(spec.parameters.volume, volume_from_record(row.text(0)).notes, spec.parameters,
                    options_.mesher_version);
}

bool PostgresJobStore::has_expired(const JobSpec& spec) const {
  return database_
      .run("SELECT 1 FROM expired WHERE owner = $1::text AND id = $2::text", spec.owner,
           spec.parameters.volume)
      .next();
}

std::optional<PostgresJobStore::Made> PostgresJobStore::made_like(const std::string& owner,
                                                                  const std::string& key) const {
  Rows row = database_.run(
      "SELECT id, record FROM jobs WHERE owner = $1::text AND result_key = $2::text AND state = 2 "
      "ORDER BY id DESC LIMIT 1",
      owner, key);
  if (!row.next()) return std::nullopt;
  Made made = {row.text(0), job_from_record(row.text(1)).mesh};
  const bool is_usable = made.mesh && is_there(*made.mesh, blobs_) && is_intact(*made.mesh, blobs_);
  if (!is_usable) made.mesh.reset();
  return made;
}

Job PostgresJobStore::remake(const std::string& id) {
  const Row row = found(std::nullopt, id);
  JobSpec spec;
  spec.owner = row.owner;
  spec.parameters = row.job.parameters;
  spec.parameters.callback.reset();
  const auto key = result_key_of(spec);
  if (key && row.result_key != *key) throw_other_version();
  Rows rows = database_.run(std::string(kRow) +
                                "WHERE j.owner = $1::text AND j.result_key = $2::text AND j.id > "
                                "$3::text ORDER BY j.id DESC LIMIT 1",
                            row.owner, row.result_key, id);
  if (rows.next()) {
    const Row youngest = row_of(rows);
    if (!is_final(youngest.job.state) || youngest.job.error) return with_progress(youngest);
  }
  try {
    return job_of(submit(spec));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    throw_volume_gone();
  }
}

}  // namespace isomesh::store::postgresql
