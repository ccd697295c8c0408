// What a person can set of the daemon.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/log.h"
#include "server/blobs.h"
#include "server/http/server.h"
#include "server/jobs/import_runner.h"
#include "server/process/import_message.h"
#include "server/store/job_store.h"
#include "server/store/operators_word.h"

namespace CLI {
class App;
}

namespace isomesh {

struct Options {
  bool check_only = false;  // tell what would be used, and end
  std::string listen = "127.0.0.1:8080";
  std::filesystem::path data = "isomesh-data";
  std::string store;  // URL of the database that keeps the records; empty: one in the data folder
  BlobOptions blobs;
  std::size_t workers = 2;
  int threads = 0;  // of the kernels; 0: one a processor
  bool open_network = false;
  unsigned drain_seconds = 30;
  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;
  std::filesystem::path tokens;  // empty: requests are not authenticated
  std::filesystem::path tls_certificate;
  std::filesystem::path tls_key;
  std::filesystem::path hospital;  // empty: no PACS is known
  std::vector<std::string> callback_targets;
  std::filesystem::path callback_secrets;
  std::filesystem::path callback_authorities;
  double callback_retry_seconds = 5;
  store::JobStoreOptions jobs;
  double keep_days = 30;
  std::uint64_t max_disk = 0;
  std::optional<std::uint64_t> disk_reserve;  // empty: what is usual on a disk of that size
  store::OperatorsWord word;
  unsigned lease_seconds = 30;
  unsigned longest_job_minutes = 60;
  http::ServerOptions http;
  volume::SizeLimits import;
  jobs::RunnerOptions runner;
  std::int64_t import_seconds = runner.bounds.time.count();
  std::uint64_t job_memory = 0;  // 0: see default_job_memory
};

// Every option also as ISOMESH_... in the environment and by its name in the file of --config,
// which may hold nothing else. `options` is filled in when `cli` parses.
void add_options(CLI::App& cli, Options& options);

// Warnings about variables of the environment that begin with ISOMESH_ and set nothing, here or in
// the clients.
std::vector<std::string> unknown_variables(const CLI::App& cli);

enum class Remarks { kNo, kYes };

// What `cli` has parsed as the lines of a file of --config that says all of it; those that nobody
// has set are comments. With remarks on what each option means.
std::string as_config(const CLI::App& cli, Remarks remarks);

// What a person is told of a mistake in the file of --config.
std::string describe_config_error(const std::string& library_text);

}  // namespace isomesh
