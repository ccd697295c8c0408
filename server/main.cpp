// isomeshd: configuration, wiring, signals.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "server/http/server.h"
#include "server/jobs/estimate.h"
#include "server/jobs/histograms.h"
#include "server/jobs/memory.h"
#include "server/jobs/volume_library.h"
#include "server/jobs/workers.h"
#include "server/mesh/context.h"
#include "server/store/data_folder.h"

namespace {

using namespace isomesh;

struct Options {
  std::string listen = "127.0.0.1:8080";
  std::filesystem::path data = "isomesh-data";
  std::size_t workers = 2;
  int threads = 0;  // of the kernels; 0: one a processor
  bool open_network = false;
  unsigned drain_seconds = 30;
  std::string log_level = "info";
  store::JobStore::Limits jobs;
  http::ServerOptions http;
  volume::ImportLimits import;
  std::uint64_t job_memory = 0;  // 0: see default_job_memory
};

// Three quarters of the machine, shared by the jobs that run at the same time.
std::uint64_t default_job_memory(std::size_t workers) {
  const auto pages = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES));
  const auto page_bytes = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return pages * page_bytes / 4 * 3 / workers;
}

// Every option also as ISOMESH_... in the environment and by its name in the file of --config.
void add_options(CLI::App& cli, Options& options) {
  cli.set_version_flag("--version", ISOMESH_VERSION);
  const char* config = std::getenv("ISOMESH_CONFIG");
  cli.set_config("--config", config == nullptr ? "" : config,
                 "Read options from this file (TOML or INI); also ISOMESH_CONFIG",
                 config != nullptr);
  cli.add_option("--listen", options.listen, "HOST:PORT, HOST:0 for a free port, or unix:PATH")
      ->envname("ISOMESH_LISTEN")
      ->capture_default_str();
  cli.add_option("--data", options.data, "Folder for volumes and meshes; created when missing")
      ->envname("ISOMESH_DATA")
      ->capture_default_str();
  cli.add_option("--workers", options.workers, "Jobs that run at the same time")
      ->envname("ISOMESH_WORKERS")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  cli.add_option("--threads", options.threads, "Threads that all jobs share; 0: one a processor")
      ->envname("ISOMESH_THREADS")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cli.add_option("--max-queue", options.jobs.max_queued, "Jobs that may wait; more get 503")
      ->envname("ISOMESH_MAX_QUEUE")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  cli.add_option("--max-finished", options.jobs.max_finished,
                 "Finished jobs that are kept; older ones are forgotten with their meshes")
      ->envname("ISOMESH_MAX_FINISHED")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  cli.add_option("--max-upload", options.http.upload.max_bytes, "Bytes of one upload")
      ->envname("ISOMESH_MAX_UPLOAD")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
  cli.add_option("--max-volume", options.import.max_sample_bytes,
                 "Bytes of one volume's samples, unpacked")
      ->envname("ISOMESH_MAX_VOLUME")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
  cli.add_option("--job-memory", options.job_memory,
                 "Bytes of memory one job may take; 0: its share of three quarters of the machine")
      ->envname("ISOMESH_JOB_MEMORY")
      ->transform(CLI::AsSizeValue(false));
  cli.add_option("--drain-seconds", options.drain_seconds,
                 "How long running jobs may finish after SIGTERM")
      ->envname("ISOMESH_DRAIN_SECONDS")
      ->capture_default_str();
  cli.add_option("--log-level", options.log_level, "debug, info, warn, error or off")
      ->envname("ISOMESH_LOG_LEVEL")
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  cli.add_flag("--open-network", options.open_network,
               "Listen beyond loopback although requests are not authenticated")
      ->envname("ISOMESH_OPEN_NETWORK");
}

sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

int run(const Options& options, const sigset_t& signals) {
  const http::Address address = http::parse_address(options.listen);
  if (!address.is_loopback() && !options.open_network) {
    throw invalid_parameter("listen",
                            "requests are not authenticated, so only loopback or a Unix socket is "
                            "listened on; --open-network allows other addresses");
  }
  if (options.threads > 0) mesh::set_thread_count(options.threads);

  const store::DataFolder folder(options.data);
  const store::BlobStore blobs(folder);
  store::VolumeStore volumes(folder);
  for (const std::string& id : volumes.unreadable()) {
    spdlog::error("the record of volume {} cannot be read; it is left where it is", id);
  }
  // Jobs do not outlive the process, so meshes of the last one have nobody to ask for them.
  blobs.sweep([&](const std::string& key) {
    return volumes.contains(key) || std::ranges::count(volumes.unreadable(), key) > 0;
  });
  store::JobStore jobs(blobs, options.jobs);
  jobs::VolumeLibrary library(folder, blobs, volumes, jobs, options.import);
  const jobs::PipelineLimits limits = {
      options.job_memory > 0 ? options.job_memory : default_job_memory(options.workers)};
  jobs::Workers workers(options.workers, jobs, volumes, blobs, limits);
  jobs::Histograms histograms(blobs);
  jobs::Estimator estimator(volumes, blobs, jobs, limits);
  http::Server server({folder, blobs, volumes, jobs, library, histograms, estimator}, options.http);

  const std::string url = server.bind(address);
  std::cout << "listening on " << url << std::endl;
  std::jthread serving([&] { server.serve(); });

  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("signal {}: draining", signal);
  server.begin_drain();
  if (!workers.drain(std::chrono::seconds(options.drain_seconds))) {
    spdlog::warn("jobs still run after {} s; they are stopped", options.drain_seconds);
  }
  server.stop();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const sigset_t signals = block_signals();
    jobs::keep_freed_memory();
    spdlog::set_default_logger(spdlog::stderr_logger_mt("isomeshd"));
    Options options;
    CLI::App cli("isomeshd turns medical volumes into surface meshes over HTTP");
    add_options(cli, options);
    try {
      cli.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      constexpr int kWrongUsage = 2;
      return cli.exit(error) == 0 ? 0 : kWrongUsage;  // 0 for --help and --version
    }
    spdlog::set_level(spdlog::level::from_str(options.log_level));
    return run(options, signals);
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return 1;
  }
}
