// A PostgreSQL of the test's own: a new cluster in a temporary folder, reached by a socket there
// and by nothing else, run by an unprivileged user where root runs the tests.
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
  // Whether its programs are installed; what needs them is skipped aloud otherwise.
  static bool is_here();

  // One for all tests of this program, started when it is asked for first. Without fsync: nobody
  // cuts its power.
  static Postgres& shared();

  // kReplicated: nothing is committed before a standby has it, too.
  // A role `guarded`, once it is created, needs its password; all others are trusted.
  enum class Disk { kFast, kDurable, kReplicated };
  explicit Postgres(Disk disk = Disk::kFast);
  struct StandbyOf {
    const Postgres& primary;  // a replicated one
  };
  explicit Postgres(const StandbyOf& standby);
  ~Postgres();
  Postgres(const Postgres&) = delete;
  Postgres& operator=(const Postgres&) = delete;

  // A new place for tables that nobody else uses, as a URL for --store.
  std::string new_place();

  // The same place on whichever of the two takes writes.
  std::string or_on(const Postgres& other, const std::string& place) const;

  // Runs SQL there; the first column of the last row, empty without one. Throws
  // std::runtime_error.
  static std::string ask(const std::string& url, const std::string& sql);

  // As `pg_ctl -m immediate`: at once, and what was not on the disk is recovered from the log.
  void stop_at_once();
  void start();
  // All of its processes stop, but their connections stay.
  void stand_still();
  void go_on();

  // One that was stopped starts anew as the standby of that one.
  void follow(const Postgres& primary);
  // The standby takes writes from now on.
  void promote();

 private:
  void signal_all(int number);
  std::vector<std::string> command(const std::string& program,
                                   const std::vector<std::string>& arguments) const;
  std::string url_of(const std::string& options) const;
  // Runs one of PostgreSQL's programs. Throws std::runtime_error when it fails.
  void run_program(const std::string& program, const std::vector<std::string>& arguments) const;
  void give_folder() const;

  const Disk disk_;
  TemporaryFolder folder_;
  std::unique_ptr<Process> server_;
  int places_ = 0;
};

}  // namespace isomesh::test
