#include "server/store/sql/schema.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "base/error.h"

namespace isomesh::store {
namespace {

std::map<std::string, std::int64_t> versions_of(SqlConnection& connection) {
  std::map<std::string, std::int64_t> versions;
  if (!connection.has_table("schema_versions")) return versions;
  Rows rows = connection.query("SELECT component, version FROM schema_versions");
  while (rows.next()) versions[rows.text(0)] = rows.integer(1);
  return versions;
}

std::string in_words_of(const SqlConnection& connection, std::string script) {
  const auto replace = [&](std::string_view name, std::string_view word) {
    for (std::size_t at = script.find(name); at != std::string::npos;
         at = script.find(name, at + word.size())) {
      script.replace(at, name.size(), word);
    }
  };
  replace("{key}", connection.key_type());
  replace("{by_key}", connection.end_of_keyed_table());
  return script;
}

std::string view_of_named_blobs(std::span<const Schema> schemas) {
  std::string all;
  for (const Schema& schema : schemas) {
    if (schema.named_blobs.empty()) continue;
    if (!all.empty()) all += " UNION ALL ";
    all += schema.named_blobs;
  }
  return "CREATE VIEW named_blobs AS " + all;
}

}  // namespace

std::vector<Schema> with_service(std::string tables, std::vector<Schema> components) {
  Schema service;
  service.component = "service";
  service.steps.push_back(std::move(tables));
  service.steps.emplace_back("CREATE INDEX jobs_of_volume ON jobs(owner, volume, id)");
  // For lists of an administrator's jobs on a volume, and of jobs until a time (job_list.h).
  service.steps.emplace_back(
      "CREATE INDEX jobs_on_volume ON jobs(volume, id); DROP INDEX jobs_by_owner; CREATE INDEX "
      "jobs_by_owner ON jobs(owner, id, accepted); CREATE INDEX jobs_by_time ON jobs(id, "
      "accepted)");
  service.named_blobs =
      "SELECT blob, 'the volume ' AS what, id AS name FROM volumes UNION ALL "
      "SELECT blob, 'a mesh of the job ', job FROM meshes";
  service.kept_from = {{"volumes", "used"}, {"jobs", "finished"}};
  components.insert(components.begin(), std::move(service));
  return components;
}

void check_versions(SqlConnection& connection, const std::string& place,
                    std::span<const Schema> schemas) {
  const auto versions = versions_of(connection);
  if (versions.empty() && connection.has_table("volumes")) {
    throw Error(ErrorCode::kUnavailable,
                place + " has tables of another program, or of an isomeshd before 0.1.0");
  }
  for (const auto& [component, version] : versions) {
    const auto known = std::ranges::find(schemas, component, &Schema::component);
    if (known == schemas.end()) {
      throw Error(
          ErrorCode::kUnavailable,
          place + " has records of a component that this isomeshd was built without: " + component);
    }
    const auto newest = static_cast<std::int64_t>(known->steps.size());
    if (version <= newest) continue;
    throw Error(ErrorCode::kUnavailable, place +
                                             " was made by a newer isomeshd: its records have "
                                             "version " +
                                             std::to_string(version) +
                                             ", this isomeshd reads versions 1 to " +
                                             std::to_string(newest));
  }
}

bool needs_upgrade(SqlConnection& connection, std::span<const Schema> schemas) {
  auto versions = versions_of(connection);
  return std::ranges::any_of(schemas, [&](const Schema& schema) {
    return versions[schema.component] < static_cast<std::int64_t>(schema.steps.size());
  });
}

void upgrade(SqlConnection& connection, std::span<const Schema> schemas) {
  connection.script(
      in_words_of(connection,
                  "CREATE TABLE IF NOT EXISTS schema_versions(component {key} NOT NULL PRIMARY "
                  "KEY, version INTEGER NOT NULL){by_key}"));
  connection.script("DROP VIEW IF EXISTS named_blobs");  // it would hold their columns
  auto versions = versions_of(connection);
  for (const Schema& schema : schemas) {
    const auto made = static_cast<std::size_t>(versions[schema.component]);
    if (made >= schema.steps.size()) continue;
    for (std::size_t n = made; n < schema.steps.size(); ++n) {
      connection.script(in_words_of(connection, schema.steps[n]));
    }
    connection.run(
        "INSERT INTO schema_versions(component, version) VALUES(?1, ?2) ON CONFLICT(component) DO "
        "UPDATE SET version = excluded.version",
        schema.component, schema.steps.size());
  }
  connection.script(view_of_named_blobs(schemas));
}

bool is_named(SqlConnection& connection, const std::string& blob) {
  return connection.query("SELECT 1 FROM named_blobs WHERE blob = ?1 LIMIT 1", blob).next();
}

}  // namespace isomesh::store
