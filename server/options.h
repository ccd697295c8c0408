// The daemon's options.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/log.h"
#include "server/blobs.h"
#include "server/callbacks/limits.h"
#include "server/http/oidc/provider.h"
#include "server/http/server.h"
#include "server/jobs/library/import_runner.h"
#include "server/store/job_store.h"
#include "server/store/operator_overrides.h"

namespace CLI {
class App;
}

namespace isomesh {

struct Options {
  bool check_only = false;  // print the configuration and exit
  std::string listen = "127.0.0.1:8080";
  std::filesystem::path data = "isomesh-data";
  std::string store;  // URL of the database of records; empty: one in the data folder
  BlobOptions blobs;
  std::size_t workers = 2;
  int threads = 0;  // for kernels; 0: one per processor
  bool open_network = false;
  unsigned drain_seconds = 30;
  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;
  std::filesystem::path tokens;  // empty: none; without a provider too: no authentication
  oidc::ProviderOptions provider;
  std::filesystem::path tls_certificate;
  std::filesystem::path tls_key;
  std::filesystem::path wing;  // configuration of the wing; empty: none
  std::vector<std::string> callback_targets;
  std::filesystem::path callback_secrets;
  std::filesystem::path callback_authorities;
  double callback_retry_seconds =
      std::chrono::duration<double>(callbacks::limits::kFirstDelay).count();
  store::JobStoreOptions jobs;
  double keep_days = 30;
  std::uint64_t max_disk = 0;
  std::optional<std::uint64_t> disk_reserve;  // empty: the default for a disk of that size
  store::OperatorOverrides overrides;
  unsigned lease_seconds = 30;
  unsigned longest_job_minutes = 60;
  http::ServerOptions http;
  volume::SizeLimits import;
  jobs::RunnerOptions runner;
  std::int64_t import_seconds = runner.bounds.time.count();
  std::uint64_t job_memory = 0;  // 0: see default_job_memory
};

// Adds all options, also as ISOMESH_... in the environment and by name in the file of --config,
// which may have no other entries. `options` is set when `cli` parses.
void add_options(CLI::App& cli, Options& options);

// Warnings about environment variables that begin with ISOMESH_ but are unknown here and in the
// clients.
std::vector<std::string> unknown_variables(const CLI::App& cli);

enum class Remarks { kNo, kYes };

// The parsed options as lines for a file of --config; defaults are comments. They change nothing if
// the comment sign is removed. `remarks` explain the options.
std::string as_config(const CLI::App& cli, Remarks remarks);

}  // namespace isomesh
