#include "tests/support/postgres.h"

#include <csignal>
#include <fstream>
#include <stdexcept>

#include <libpq-fe.h>
#include <unistd.h>

namespace isomesh::test {
namespace {

// "nobody" and its group on Debian.
constexpr uid_t kNobody = 65534;

// Debian has a folder per version, and no links to programs of servers.
std::filesystem::path programs() {
  std::filesystem::path newest;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator("/usr/lib/postgresql", absent)) {
    const auto folder = entry.path() / "bin";
    const bool is_newer = newest.empty() || std::stoi(entry.path().filename()) >
                                                std::stoi(newest.parent_path().filename());
    if (std::filesystem::exists(folder / "initdb") && is_newer) newest = folder;
  }
  return newest;
}

std::string error_of(PGconn* connection) { return PQerrorMessage(connection); }

}  // namespace

bool Postgres::is_here() { return !programs().empty(); }

Postgres& Postgres::shared() {
  static Postgres server;
  return server;
}

Postgres::Postgres(Disk disk) : disk_(disk) {
  give_folder();
  run_program("initdb", {"--pgdata", folder_ / "data", "--username", "isomesh", "--auth", "trust",
                         "--encoding", "UTF8", "--locale", "C", "--no-sync", "--no-instructions"});
  // All other roles are trusted.
  const std::filesystem::path rules = folder_ / "data/pg_hba.conf";
  write_file(rules, "local all guarded scram-sha-256\n" + read_file(rules));
  start();
}

Postgres::Postgres(const StandbyOf& standby) : disk_(standby.primary.disk_) {
  give_folder();
  follow(standby.primary);
}

void Postgres::give_folder() const {
  if (::geteuid() == 0 && ::chown(folder_.path().c_str(), kNobody, kNobody) != 0) {
    throw std::runtime_error("a folder for PostgreSQL");
  }
}

void Postgres::run_program(const std::string& program,
                           const std::vector<std::string>& arguments) const {
  const Finished done = run(command(program, arguments));
  if (done.status != 0) throw std::runtime_error(program + ": " + done.errors);
}

Postgres::~Postgres() { stop_at_once(); }

// The server ends with the test's process, however that ends.
std::vector<std::string> Postgres::command(const std::string& program,
                                           const std::vector<std::string>& arguments) const {
  std::vector<std::string> words = {"setpriv", "--pdeathsig", "QUIT"};
  if (::geteuid() == 0) {
    words.insert(words.end(), {"--reuid", std::to_string(kNobody), "--regid",
                               std::to_string(kNobody), "--clear-groups"});
  }
  words.push_back(programs() / program);
  words.insert(words.end(), arguments.begin(), arguments.end());
  return words;
}

void Postgres::start() {
  std::vector<std::string> arguments = {"-D", folder_ / "data", "-k", folder_.path().string()};
  std::vector<std::string> settings = {"listen_addresses=", "shared_buffers=32MB",
                                       "max_connections=300", "jit=off",
                                       // It would delay events while it counts rows.
                                       "autovacuum=off", "log_min_messages=fatal"};
  if (disk_ == Disk::kReplicated) settings.emplace_back("synchronous_standby_names=*");
  if (disk_ == Disk::kFast) {
    settings.insert(settings.end(), {"fsync=off", "full_page_writes=off"});
  }
  for (const std::string& setting : settings) {
    arguments.insert(arguments.end(), {"-c", setting});
  }
  server_ = std::make_unique<Process>(command("postgres", arguments));
  const bool answers = eventually([&] {
    return PQping(url_of("").c_str()) == PQPING_OK || server_->ends_within(std::chrono::seconds(0));
  });
  if (!answers || PQping(url_of("").c_str()) != PQPING_OK) {
    throw std::runtime_error("PostgreSQL does not start: " + server_->errors());
  }
}

void Postgres::stop_at_once() {
  if (!server_) return;
  server_->send_signal(SIGQUIT);
  server_->wait();
  server_.reset();
}

void Postgres::stand_still() { signal_all(SIGSTOP); }

void Postgres::go_on() { signal_all(SIGCONT); }

void Postgres::signal_all(int number) {
  const std::string pid = std::to_string(server_->pid());
  server_->send_signal(number);
  std::ifstream children("/proc/" + pid + "/task/" + pid + "/children");
  for (pid_t child = 0; children >> child;) ::kill(child, number);
}

void Postgres::follow(const Postgres& primary) {
  std::filesystem::remove_all(folder_ / "data");
  run_program("pg_basebackup",
              {"--host", primary.folder_.path().string(), "--username", "isomesh", "--pgdata",
               folder_ / "data", "--write-recovery-conf", "--checkpoint", "fast", "--no-sync"});
  start();
}

void Postgres::promote() { run_program("pg_ctl", {"promote", "--pgdata", folder_ / "data"}); }

std::string Postgres::or_on(const Postgres& other, const std::string& place) const {
  const std::string mine = "host=" + folder_.path().string();
  std::string both = place;
  both.replace(both.find(mine), mine.size(), mine + ',' + other.folder_.path().string());
  return both + "&target_session_attrs=read-write";
}

std::string Postgres::url_of(const std::string& options) const {
  return "postgresql:///postgres?user=isomesh&host=" + folder_.path().string() + options;
}

std::string Postgres::new_place() {
  const std::string name = "place" + std::to_string(++places_);
  ask(url_of(""), "CREATE SCHEMA " + name);
  return url_of("&options=-csearch_path%3D" + name);
}

std::string Postgres::ask(const std::string& url, const std::string& sql) {
  const std::unique_ptr<PGconn, decltype(&PQfinish)> connection(PQconnectdb(url.c_str()),
                                                                &PQfinish);
  if (PQstatus(connection.get()) != CONNECTION_OK) {
    throw std::runtime_error(error_of(connection.get()));
  }
  const std::unique_ptr<PGresult, decltype(&PQclear)> result(PQexec(connection.get(), sql.c_str()),
                                                             &PQclear);
  const ExecStatusType status = PQresultStatus(result.get());
  if (status != PGRES_TUPLES_OK && status != PGRES_COMMAND_OK) {
    throw std::runtime_error(error_of(connection.get()));
  }
  const int rows = PQntuples(result.get());
  return rows == 0 ? "" : PQgetvalue(result.get(), rows - 1, 0);
}

}  // namespace isomesh::test
