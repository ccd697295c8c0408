// A running isomeshd of the test's own, and the command that talks to it.
#pragma once

#include <csignal>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "client/isomesh/client.h"
#include "proto/types.h"
#include "tests/api/http.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

// Starts with a data folder of its own on a free port of loopback; killed when it goes.
class Daemon {
 public:
  // `arguments` are added to those. Throws std::runtime_error when it does not listen.
  explicit Daemon(const std::vector<std::string>& arguments = {});
  // On a data folder that outlives it and the address of a --listen; `prefix` comes before its
  // program's name.
  Daemon(const std::filesystem::path& data, const std::string& listen,
         const std::vector<std::string>& arguments = {},
         const std::vector<std::string>& prefix = {});

  // As its first line names it: http://127.0.0.1:PORT or unix:PATH.
  const std::string& url() const { return url_; }
  const std::filesystem::path& data() const { return data_; }

  // SIGTERM, and its exit status.
  int stop();
  void send_signal(int number) { process_.send_signal(number); }
  pid_t pid() const { return process_.pid(); }
  void terminate() { process_.send_signal(SIGTERM); }
  int wait() { return process_.wait(); }
  // Everything written to standard error so far.
  std::string errors() const { return process_.errors(); }
  bool ends_within(std::chrono::seconds longest) { return process_.ends_within(longest); }

  // A request over a connection of its own.
  Answer send(const std::string& method, const std::string& target, const std::string& body = {},
              const Headers& headers = {}) const;
  Answer get(const std::string& target, const Headers& headers = {}) const {
    return send("GET", target, {}, headers);
  }

  Client client() const { return Client({.server = url_}); }

  // Runs `isomesh --server URL` with these arguments.
  Finished command(const std::vector<std::string>& arguments) const;

 private:
  TemporaryFolder folder_;
  std::filesystem::path data_;
  Process process_;
  std::string url_;
};

// Runs an isomeshd on that folder and a free port until it ends, as one that must not start does.
Finished refused_start(const std::filesystem::path& data,
                       const std::vector<std::string>& arguments = {});

// Samples of uint8 and the query that describes them.
struct RawUpload {
  std::string bytes;
  std::string query;                 // dims=..&type=uint8
  std::vector<std::string> options;  // the same for the command
};

RawUpload raw_upload(const SampleVolume<std::uint8_t>& volume);

// A sphere at iso 100, of some thousand triangles.
RawUpload sphere_upload();

// Noise at iso 50 whose surface is extracted soon, also on a busy machine, and takes minutes for
// slow_smoothing(1000).
RawUpload rough_upload();

// Members of a job that smooths for long, by so many passes.
std::string slow_smoothing(int passes);

// More samples of noise, whose surface has a million triangles at iso 50.
RawUpload long_upload();

// Uploads it; throws std::runtime_error when it is refused.
Volume upload(const Daemon& daemon, const RawUpload& raw);

// The body of a request for a job with further members such as `"passes": 3`.
std::string job_body(const std::string& volume, double iso, const std::string& members = {});

// Submits a job with further members such as `"passes": 3`.
Job submit(const Daemon& daemon, const Volume& volume, double iso, const std::string& members = {});

// A sphere's job that has succeeded.
Job finished_job(const Daemon& daemon, const std::string& members = {});

// A job that runs for longer than any test waits for, and has begun to smooth.
Job long_job(const Daemon& daemon, double iso = 50);

inline constexpr const char* kJobProgram = "isomesh-job";

// The processes that a daemon makes meshes in.
std::set<pid_t> job_processes(const Daemon& daemon);

// Lets a daemon's only worker finish a job, then stops its process, so that no other job ends
// before it is let go.
class HeldWorker {
 public:
  explicit HeldWorker(const Daemon& daemon);
  ~HeldWorker() { let_go(); }
  HeldWorker(const HeldWorker&) = delete;
  HeldWorker& operator=(const HeldWorker&) = delete;

  void let_go() { ::kill(process_, SIGCONT); }

 private:
  pid_t process_ = 0;
};

}  // namespace isomesh::test
