// isomeshd: configuration, wiring, signals.
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/command_line/completion.h"
#include "base/command_line/exit_status.h"
#include "base/command_line/help.h"
#include "base/descriptor.h"
#include "base/log.h"
#include "base/niceness.h"
#include "base/text.h"
#include "proto/json_tree.h"
#include "server/blobs.h"
#include "server/callbacks/callbacks.h"
#include "server/callbacks/signature.h"
#include "server/callbacks/targets.h"
#include "server/commands.h"
#include "server/configured_files.h"
#include "server/ending.h"
#include "server/http/app/outcomes.h"
#include "server/http/guards/tokens.h"
#include "server/http/observe/metrics.h"
#include "server/http/oidc/provider.h"
#include "server/http/server.h"
#include "server/jobs/library/histograms.h"
#include "server/jobs/library/label_lists.h"
#include "server/jobs/library/volume_library.h"
#include "server/jobs/making/memory.h"
#include "server/jobs/queue/estimate.h"
#include "server/jobs/queue/housekeeper.h"
#include "server/jobs/queue/workers.h"
#include "server/mesh/parallel.h"
#include "server/net/address.h"
#include "server/net/descriptors.h"
#include "server/net/tls.h"
#include "server/options.h"
#include "server/process/child.h"
#include "server/record_stores.h"
#include "server/store/files/data_folder.h"
#include "server/store/postgresql/connection.h"
#include "server/store/retention.h"
#include "server/wings.h"

namespace {

using namespace isomesh;

// Three quarters of the machine's memory, divided by the number of concurrent jobs.
std::uint64_t default_job_memory(std::size_t workers) {
  return jobs::usable_memory() / 4 * 3 / std::max<std::size_t>(workers, 1);
}

// In the folder of a build or of an installation.
process::Program program_of_ours(const std::string& name) {
  const auto folder = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  for (const auto& program :
       {folder / name, (folder / ISOMESH_LIBEXEC / name).lexically_normal()}) {
    if (::access(program.c_str(), X_OK) == 0) return process::hold_program(program);
  }
  throw Error(ErrorCode::kInternal, "the program " + name +
                                        " is missing: it is neither beside isomeshd nor in " +
                                        ISOMESH_LIBEXEC + " relative to it");
}

// A quarter of the retention time, within bounds: expired objects are removed soon, and the disk
// cannot fill up between two rounds.
std::chrono::milliseconds housekeeping_interval(std::chrono::milliseconds keep) {
  return std::clamp<std::chrono::milliseconds>(keep / 4, std::chrono::seconds(1),
                                               std::chrono::seconds(30));
}

// How far the clock may be ahead of the last stored time. A smaller error expires objects early by
// at most a quarter of their time.
std::chrono::milliseconds clock_tolerance(std::chrono::milliseconds keep) {
  return std::clamp<std::chrono::milliseconds>(keep / 4, std::chrono::hours(1),
                                               std::chrono::days(7));
}

// The files that are read again on SIGHUP; null for those that are not configured.
struct Files {
  std::unique_ptr<http::Tokens> tokens;
  std::unique_ptr<net::TlsFiles> tls;
};

Files open_files(const Options& options, const net::Address& address, http::ReadBy reader) {
  Files files;
  if (!options.tokens.empty())
    files.tokens = std::make_unique<http::Tokens>(options.tokens, reader);
  if (!options.tls_certificate.empty() && !address.is_unix()) {
    files.tls = std::make_unique<net::TlsFiles>(options.tls_certificate, options.tls_key);
  }
  // Otherwise every callback would fail, without a word at the start.
  net::check_authorities("callback-ca", options.callback_authorities);
  net::check_authorities("blob-ca", options.blobs.authorities);
  net::check_authorities("oidc-ca", options.provider.authorities);
  return files;
}

void check_reach(const Options& options, const net::Address& address, const Files& files) {
  if (address.is_loopback()) return;
  const bool has_logins = files.tokens || !options.provider.issuer.empty();
  if (!has_logins && !options.open_network) {
    throw invalid_parameter(
        "listen",
        "requests are not authenticated, so only loopback addresses and Unix sockets are allowed. "
        "Use --tokens, --oidc-issuer or --open-network for other addresses");
  }
  if (has_logins && !files.tls) {
    log_warning("tokens and volumes cross the network unencrypted; --tls-cert encrypts them");
  }
}

std::vector<std::string> callback_secrets(const Options& options) {
  if (!options.callback_secrets.empty()) {
    return callbacks::read_callback_secrets(options.callback_secrets);
  }
  if (options.callback_targets.empty()) return {};
  throw invalid_parameter("callback-secret-file",
                          "is required with --callback-allow, because callbacks are signed");
}

callbacks::CallbackOptions callback_options(const Options& options) {
  return {.secrets = callback_secrets(options),
          .authorities = options.callback_authorities,
          .first_delay = std::chrono::round<std::chrono::milliseconds>(
              std::chrono::duration<double>(options.callback_retry_seconds))};
}

// Keeps the previous content if the file cannot be read.
void reload_one(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    log_error("{}; the previous content stays in use", error.what());
  }
}

void reload(const Options& options, const Files& files, callbacks::Callbacks& callbacks) {
  log_info("signal {}: reloading files", SIGHUP);
  if (files.tokens) reload_one([&] { files.tokens->reload(); });
  if (files.tls) reload_one([&] { files.tls->reload(); });
  reload_one([&] { callbacks.set_secrets(callback_secrets(options)); });
}

// Checks the places of files as a start would, without creating any.
void check_places(const Options& options) {
  std::error_code absent;
  if (options.data.empty()) throw invalid_parameter("data", "must name a folder");
  if (std::filesystem::exists(options.data, absent) &&
      !std::filesystem::is_directory(options.data, absent)) {
    throw invalid_parameter("data", options.data.string() + " is not a folder");
  }
}

// Prints the effective configuration. Throws as a start would for errors in it; touches neither the
// data folder nor the address.
int tell_configuration(const Options& options, const CLI::App& cli) {
  const net::Address address = net::parse_address(options.listen);
  if (!options.store.empty()) store::postgresql::check_url(options.store);
  ConfiguredFiles others = files_of_store(options);
  if (!options.wing.empty()) {
    std::ranges::move(wing_entry().check(options.wing), std::back_inserter(others));
  }
  check_configured_files(options, others);
  check_reach(options, address, open_files(options, address, http::ReadBy::kAdministrator));
  check_places(options);
  const callbacks::CallbackTargets targets(options.callback_targets);
  callback_secrets(options);
  if (!options.provider.issuer.empty()) oidc::check_options(options.provider);
  check_blobs(options.blobs);
  std::cout << as_config(cli, Remarks::kNo);
  return 0;
}

// Stores without their places, which may have passwords in them.
void tell_start(const Options& options, const std::string& url, std::size_t connections) {
  LogLine("start")
      .add("version", ISOMESH_VERSION)
      .add("url", url)
      .add("records", options.store.empty() ? "sqlite" : "postgresql")
      .add("blobs", kind_of(options.blobs))
      .add("workers", options.workers)
      .add("tokens", options.tokens.empty() ? "no" : "yes")
      .add("oidc", options.provider.issuer.empty() ? "no" : "yes")
      .add("connections", connections);
}

// Only one of the daemons that share records does the work of wings.
void take_task(RecordStores& records) {
  const std::string reason = records.keep_task();
  if (reason.empty()) return;
  throw Error(ErrorCode::kUnavailable, "only one daemon may have --" + wing_entry().option +
                                           ", and this one cannot: " + reason);
}

void run_interrupted_again(store::JobStore& jobs) {
  try {
    const std::size_t count = jobs.reap();
    if (count == 0) return;
    log_warning("{} jobs were running when a daemon stopped; they are run again", count);
  } catch (const Error& error) {
    // A damaged database, for instance, which serves what can be read. The workers try it again.
    log_error("jobs that were running when a daemon stopped cannot be run again yet: {}",
              error.what());
  }
}

int run(const Options& options, const sigset_t& signals) {
  // First, because all else opens some.
  const std::size_t descriptors = net::raise_descriptor_limit();
  std::jthread starting = end_start_on_signal(signals);
  const net::Address address = net::parse_address(options.listen);
  check_configured_files(options);
  const Files files = open_files(options, address, http::ReadBy::kService);
  check_reach(options, address, files);
  std::unique_ptr<oidc::Provider> provider;
  if (!options.provider.issuer.empty()) {
    provider = std::make_unique<oidc::Provider>(options.provider);
  }
  const callbacks::CallbackTargets targets(options.callback_targets);
  if (options.threads > 0) mesh::set_thread_count(options.threads);

  const store::DataFolder folder(options.data, options.disk_reserve);
  const auto keep = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::duration<double, std::chrono::days::period>(options.keep_days));
  const std::unique_ptr<store::BlobStore> opened_blobs = open_blobs(options.blobs, folder);
  store::BlobStore& blobs = *opened_blobs;
  const auto records = open_record_stores(options, folder, blobs, clock_tolerance(keep));
  store::VolumeStore& volumes = records->volumes();
  store::JobStore& jobs = records->jobs();
  run_interrupted_again(jobs);
  store::RetentionOptions retention_options;
  retention_options.keep = keep;
  retention_options.max_bytes = options.max_disk;
  retention_options.now = [&records] { return records->now(); };
  store::Retention retention(jobs, volumes, blobs, folder.scratch(), retention_options);
  blobs.limit_room(options.max_disk, [&retention](const store::Incoming& incoming) {
    retention.make_room(incoming);
  });
  jobs::RunnerOptions runner = options.runner;
  runner.bounds.time = std::chrono::seconds(options.import_seconds);
  runner.program = program_of_ours("isomesh-import");
  jobs::VolumeLibrary library(folder, blobs, volumes, retention, options.import, runner);
  http::Metrics metrics;
  callbacks::Callbacks callbacks(records->outbox(), targets, callback_options(options),
                                 http::callback_reporter(metrics));
  const jobs::PipelineLimits limits = {
      options.job_memory > 0 ? options.job_memory : default_job_memory(options.workers)};
  const jobs::JobProgram job_program = {
      .file = program_of_ours("isomesh-job"),
      .setup = {.threads = mesh::thread_count(),
                .memory_bytes = limits.memory_bytes,
                .scratch = std::filesystem::canonical(folder.scratch()).string()}};
  const jobs::Housekeeper housekeeper(retention, library, housekeeping_interval(keep));
  jobs::Histograms histograms(blobs);
  jobs::LabelLists labels(blobs);
  jobs::Estimator estimator(volumes, blobs, jobs, limits, job_program);
  http::ServerOptions server_options = options.http;
  server_options.tls = files.tls.get();
  server_options.part_bytes = options.max_disk / 4;
  server_options.connections = net::connections_within(descriptors);
  if (!options.wing.empty()) take_task(*records);
  const std::unique_ptr<http::Wing> wing = wing_entry().open(
      {.file = options.wing,
       .max_upload_bytes = options.http.upload.max_bytes,
       .keep = std::chrono::duration_cast<std::chrono::hours>(keep),
       .program = program_of_ours},
      {.folder = folder,
       .blobs = blobs,
       .volumes = volumes,
       .jobs = jobs,
       .library = library,
       .labels = labels,
       .records = records->database(),
       .audit = records->audit(),
       .believed_now = [&records] { return records->now(); },
       .keep_task = [&records] { return records->keep_task(); },
       .has_task =
           [&records](store::SqlConnection& connection) { return records->has_task(connection); }});
  const http::Services services = {.folder = folder,
                                   .blobs = blobs,
                                   .volumes = volumes,
                                   .jobs = jobs,
                                   .outbox = records->outbox(),
                                   .audit = records->audit(),
                                   .library = library,
                                   .histograms = histograms,
                                   .labels = labels,
                                   .estimator = estimator,
                                   .retention = retention,
                                   .metrics = metrics,
                                   .callbacks = callbacks,
                                   .callback_targets = targets,
                                   .tokens = files.tokens.get(),
                                   .provider = provider.get(),
                                   .wing = wing.get()};
  http::Server server(services, server_options);
  const std::string url = server.bind(address);
  server.start();
  starting.request_stop();
  starting.join();
  // Declared after the server, so that the workers end first and the end of their last job is still
  // logged and counted.
  const jobs::WorkerOptions worker_options = {
      .threads = options.workers,
      .program = job_program,
      .limits = limits,
      .lease = std::chrono::seconds(options.lease_seconds),
      .longest_job = std::chrono::minutes(options.longest_job_minutes)};
  jobs::Workers workers(worker_options, jobs, volumes, blobs);

  tell_start(options, url, server_options.connections);
  std::cout << "listening on " << url << std::endl;

  int signal = 0;
  while (::sigwait(&signals, &signal) == 0 && signal == SIGHUP) reload(options, files, callbacks);
  log_info("signal {}: draining", signal);
  server.begin_drain();
  if (wing) wing->begin_drain();
  if (!workers.drain(std::chrono::seconds(options.drain_seconds))) {
    log_warning("jobs are still running after {} s; they are stopped and put back",
                options.drain_seconds);
  }
  if (wing) wing->stop();
  server.stop();
  return 0;
}

// A daemon that cannot start reports the reason regardless of the log's level, in the log's form if
// machines read it.
void tell_failure(LogFormat format, const std::string& reason) {
  if (format == LogFormat::kText) {
    std::cerr << "isomeshd: " << printable_lines(valid_utf8(reason)) << std::endl;
    return;
  }
  start_log(format, LogLevel::kCritical);
  log_message(LogLevel::kCritical, "isomeshd: {}", {reason});
}

std::string usage_message(const CLI::App* cli, const CLI::Error& error) {
  return "isomeshd: " + CLI::FailureMessage::simple(cli, error);
}

}  // namespace

int main(int argc, char** argv) {
  hold_standard_descriptors();
  LogFormat log_format = LogFormat::kText;
  try {
    end_clearly_without_memory();
    const sigset_t signals = block_signals();
    jobs::keep_freed_memory();
    be_prompt();
    start_log(LogFormat::kText, LogLevel::kInfo);
    Options options;
    CLI::App cli("isomeshd turns medical volumes into surface meshes over HTTP", "isomeshd");
    cli.failure_message(usage_message);
    cli.formatter(command_line::wrapped_help());
    add_options(cli, options);
    Commands commands(cli, options);
    if (argc > 1 && std::string_view(argv[1]) == "complete") {
      std::cout << command_line::candidates(cli, {argv + 2, argv + argc}).lines << std::flush;
      return 0;
    }
    try {
      cli.parse(argc, argv);
    } catch (const CLI::ConfigError& error) {
      tell_failure(log_format, std::string("the file of --config: ") + error.what());
      return exit_status::kWrongUsage;
    } catch (const CLI::ParseError& error) {
      return cli.exit(error) == 0 ? 0 : exit_status::kWrongUsage;  // 0 for --help and --version
    }
    if (commands.asked()) {
      const int status = commands.run();
      std::cout.flush();
      if (!std::cout) throw Error(ErrorCode::kInternal, "standard output cannot be written to");
      return status;
    }
    log_format = options.log_format;
    start_log(log_format, options.log_level);
    for (const std::string& warning : unknown_variables(cli)) log_warning("{}", warning);
    if (options.check_only) return tell_configuration(options, cli);
    return run(options, signals);
  } catch (const std::exception& error) {
    const std::string_view reason = shortage(error);
    tell_failure(log_format, reason.empty() ? error.what() : std::string(reason));
    return exit_status::kRefused;
  }
}
