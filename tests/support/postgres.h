// A PostgreSQL cluster of the test, in a temporary folder, reachable only by a socket there. It
// runs as an unprivileged user if root runs the tests.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::test {

class Postgres {
 public:
  // True if its programs are installed; otherwise tests report that they are skipped.
  static bool is_here();

  // Shared by all tests of this program, started on first use. Without fsync: it needs no crash
  // safety.
  static Postgres& shared();

  // kReplicated: commits wait for a standby. A role `guarded`, if created, needs its password; all
  // others are trusted.
  enum class Disk { kFast, kDurable, kReplicated };
  explicit Postgres(Disk disk = Disk::kFast);
  struct StandbyOf {
    const Postgres& primary;  // a replicated one
  };
  explicit Postgres(const StandbyOf& standby);
  ~Postgres();
  Postgres(const Postgres&) = delete;
  Postgres& operator=(const Postgres&) = delete;

  // A new, unused place for tables, as a URL for --store.
  std::string new_place();

  // The same place on whichever of the two accepts writes.
  std::string or_on(const Postgres& other, const std::string& place) const;

  // Runs SQL; returns the first column of the last row, empty if there is none. Throws
  // std::runtime_error.
  static std::string ask(const std::string& url, const std::string& sql);

  // As `pg_ctl -m immediate`: stops at once; the next start recovers from the log.
  void stop_at_once();
  void start();
  // Suspends all processes; connections stay open.
  void stand_still();
  void go_on();

  // Starts a stopped cluster as the standby of `primary`.
  void follow(const Postgres& primary);
  void promote();

 private:
  void signal_all(int number);
  std::vector<std::string> command(const std::string& program,
                                   const std::vector<std::string>& arguments) const;
  std::string url_of(const std::string& options) const;
  // Runs one of PostgreSQL's programs. Throws std::runtime_error if it fails.
  void run_program(const std::string& program, const std::vector<std::string>& arguments) const;
  void give_folder() const;

  const Disk disk_;
  TemporaryFolder folder_;
  std::unique_ptr<Process> server_;
  int places_ = 0;
};

}  // namespace isomesh::test
