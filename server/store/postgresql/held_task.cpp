#include "server/store/postgresql/held_task.h"

#include "base/log.h"

namespace isomesh::store::postgresql {

HeldTask::~HeldTask() {
  try {
    const Lock lock(mutex_);
    if (sure_until_ == Steady()) return;
    database_.run(Change::kRepeatable, "DELETE FROM tasks WHERE name = ?1 AND node = ?2::uuid",
                  name_, database_.node());
  } catch (const std::exception& error) {
    log_warning("the task {} could not be given back, and expires: {}", name_, error.what());
  }
}

std::string HeldTask::keep() {
  const Lock lock(mutex_);
  const Steady asked = options_.now();
  try {
    const std::size_t taken = database_.run(
        Change::kRepeatable,
        "INSERT INTO tasks AS held(name, node, folder, held_until) VALUES(?1, ?2::uuid, ?3, "
        "isomesh_now() + ?4) ON CONFLICT(name) DO UPDATE SET node = excluded.node, folder = "
        "excluded.folder, held_until = excluded.held_until WHERE held.node = excluded.node OR "
        "held.folder = excluded.folder OR held.held_until < isomesh_now()",
        name_, database_.node(), database_.node_name(),
        std::chrono::microseconds(options_.lease).count());
    sure_until_ = taken > 0 ? asked + options_.sure : Steady();
    return taken > 0 ? "" : "another isomeshd with this database processes the " + name_;
  } catch (const std::exception& error) {
    if (options_.now() < sure_until_) return "";
    return error.what();
  }
}

bool HeldTask::is_ours(SqlConnection& connection) const {
  return connection
      .query("SELECT 1 FROM tasks WHERE name = ?1 AND node = ?2::uuid FOR SHARE", name_,
             database_.node())
      .next();
}

// Releases the lock itself: the server notices only some time later that a connection has ended.
ExclusiveTask::~ExclusiveTask() {
  if (!is_ours_) return;
  try {
    connection_.wait_until(Connection::Clock::now() + Connection::kPatience);
    connection_.query("SELECT pg_advisory_unlock_all()");
  } catch (const std::exception& error) {
    log_debug("a task is given back only when the database notices the end of its connection: {}",
              error.what());
  }
}

}  // namespace isomesh::store::postgresql
