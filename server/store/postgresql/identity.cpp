#include "server/store/postgresql/identity.h"

#include <filesystem>
#include <span>

#include <spdlog/spdlog.h>

#include "base/files.h"
#include "base/ids.h"
#include "proto/error.h"
#include "server/store/files/files.h"
#include "server/store/microseconds.h"

namespace isomesh::store::postgresql {
namespace {

// The first word: SQLite's engine writes a number behind it.
std::string name_of_blobs(const DataFolder& folder) {
  if (!std::filesystem::exists(folder.blobs_identity())) return {};
  const std::string text = read_whole(folder.blobs_identity());
  return text.substr(0, text.find_first_of(" \n"));
}

void name_blobs(const DataFolder& folder, const std::string& name) {
  const ScratchFolder scratch(folder.scratch());
  const std::filesystem::path draft = scratch.path() / "identity";
  const std::string text = name + '\n';
  {
    File file = File::create(draft);
    file.write(std::as_bytes(std::span(text)));
    file.sync();
  }
  move_to(draft, folder.blobs_identity());
  sync_folder(folder.blobs());
}

// The database's name; `proposed` where it has none yet.
std::string name_of_database(Database& database, const std::string& proposed) {
  return database.ask([&](Connection& connection, bool) {
    Transaction transaction(connection);
    transaction->run("LOCK TABLE identity IN SHARE ROW EXCLUSIVE MODE");
    transaction->run(
        "INSERT INTO identity SELECT $1::text, isomesh_now() WHERE NOT EXISTS (SELECT 1 FROM "
        "identity)",
        proposed);
    Rows row = transaction->run("SELECT id FROM identity");
    row.next();
    const std::string name = row.text(0);
    transaction.commit();
    return name;
  });
}

}  // namespace

Identity::Identity(Database& database, const DataFolder& folder, const OperatorsWord& word,
                   std::chrono::milliseconds tolerance)
    : database_(database),
      clock_(last_seen(database, word), {.tolerance = tolerance, .wall = [&database] {
                                           return store::from_us(database.now_us());
                                         }}) {
  const std::string blobs = name_of_blobs(folder);
  const std::string name = name_of_database(database, random_hex(16));
  if (blobs == name) return;
  if (!blobs.empty() && !word.adopt) {
    throw Error(ErrorCode::kUnavailable,
                "the database and the files of volumes and meshes do not belong together. Name the "
                "database that belongs to them, or bring their records there with `isomeshd move`; "
                "or start once with --adopt to go on with what is there: files that the database "
                "does not name are then put into quarantine");
  }
  name_blobs(folder, name);
}

Time Identity::now() {
  const bool was_doubted = clock_.is_doubted();
  const Time believed = clock_.now();
  if (clock_.is_doubted() && !was_doubted) {
    spdlog::warn("the database's clock is far ahead: nothing is taken for older than it was");
  }
  const std::int64_t us = store::to_us(believed);
  try {
    database_.run("UPDATE identity SET seen = $1::bigint WHERE seen < $1::bigint", us);
  } catch (const Error& error) {
    spdlog::warn("the time cannot be marked now, and is the next time: {}", error.what());
  }
  return database_.from_us(us);
}

Time Identity::last_seen(Database& database, const OperatorsWord& word) {
  Rows row = database.run("SELECT seen FROM identity");
  if (word.trust_clock || !row.next()) return store::from_us(database.now_us());
  return store::from_us(row.integer(0));
}

}  // namespace isomesh::store::postgresql
