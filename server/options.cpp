#include "server/options.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/command_line/closest.h"
#include "base/text.h"
#include "server/config_file.h"
#include "server/http/guards/origin.h"

namespace isomesh {
namespace {

const std::map<std::string, LogLevel> kLogLevels = {{"debug", LogLevel::kDebug},
                                                    {"info", LogLevel::kInfo},
                                                    {"warn", LogLevel::kWarn},
                                                    {"error", LogLevel::kError},
                                                    {"off", LogLevel::kOff}};
const std::map<std::string, LogFormat> kLogFormats = {{"text", LogFormat::kText},
                                                      {"json", LogFormat::kJson}};

// The library stores an enumerator's number instead of its name.
template <class Enum>
std::string name_in(const std::map<std::string, Enum>& names, const std::string& number) {
  for (const auto& [name, value] : names) {
    if (std::to_string(static_cast<int>(value)) == number) return name;
  }
  return number;
}

std::string value_of(const CLI::Option& option) {
  const bool is_flag = option.get_expected_max() == 0;
  if (option.count() == 0) return is_flag ? "false" : option.get_default_str();
  const std::string value = CLI::detail::join(option.reduced_results(), ",");
  const std::string& name = option.get_lnames().front();
  if (name == "log-level") return name_in(kLogLevels, value);
  if (name == "log-format") return name_in(kLogFormats, value);
  return value;
}

// CLI::CheckedTransformer, but its error lists only the names.
template <class Enum>
CLI::Validator one_of(const std::map<std::string, Enum>& names) {
  const CLI::CheckedTransformer checked(names);
  return {[checked, &names](std::string& text) {
            if (checked(text).empty()) return std::string();
            std::string list;
            for (const auto& entry : names) list += (list.empty() ? "" : ", ") + entry.first;
            return text + " is not one of " + list;
          },
          ""};
}

// CLI::Range accepts NaN.
CLI::Validator number_between(double least, double most) {
  const CLI::Range range(least, most);
  return {[range](std::string& text) {
            double number = 0;
            const bool is_nan = CLI::detail::lexical_cast(text, number) && std::isnan(number);
            return is_nan ? text + " is not a number" : range(text);
          },
          range.get_description()};
}

// Bytes with a unit. CLI::AsSizeValue misreads negative values and those beyond 64 bits.
CLI::Validator size_of_bytes(std::uint64_t least = 0) {
  const CLI::AsSizeValue with_unit(false);
  return {
      [with_unit, least](std::string& text) {
        const std::string given = text;
        std::uint64_t number = 0;
        if (std::from_chars(given.data(), given.data() + given.size(), number).ec != std::errc()) {
          return given + " is not a number of bytes";
        }
        std::string wrong = with_unit(text);
        if (!wrong.empty()) return wrong;
        CLI::detail::lexical_cast(text, number);
        return number < least ? given + " is too small" : "";
      },
      with_unit.get_description()};
}

// A page's origin such as "https://viewer.example", or `*` for all. Any other spelling than that of
// browsers would match no page.
std::string wrong_origin(const std::string& text) {
  const std::string origin = http::origin_of(text);
  if (text == "*" || (!origin.empty() && lower(text) == origin)) return "";
  return text + (origin.empty() ? " is not an origin such as https://viewer.example"
                                : " matches no page; the origin is " + origin);
}

std::string wrong_host(const std::string& text) {
  const bool is_name = !text.empty() && text.find_first_of(" \t/") == std::string::npos;
  return is_name ? "" : '"' + text + "\" is not a host name";
}

void add_log_options(CLI::App& cli, Options& options) {
  cli.add_option("--log-level", options.log_level,
                 "Least severe messages to log: debug, info, warn, error or off")
      ->envname("ISOMESH_LOG_LEVEL")
      ->transform(one_of(kLogLevels))
      ->default_str("info");
  cli.add_option("--log-format", options.log_format,
                 "Format of the log lines on standard error: text or json")
      ->envname("ISOMESH_LOG_FORMAT")
      ->transform(one_of(kLogFormats))
      ->default_str("text");
}

void add_security_options(CLI::App& cli, Options& options) {
  cli.add_option("--tokens", options.tokens,
                 "File of the tokens that requests need; `isomeshd token add` creates them. SIGHUP "
                 "reloads it")
      ->envname("ISOMESH_TOKENS");
  auto* certificate =
      cli.add_option("--tls-cert", options.tls_certificate,
                     "Certificate file (PEM), to listen with https. SIGHUP reloads it and the key")
          ->envname("ISOMESH_TLS_CERT");
  cli.add_option("--tls-key", options.tls_key, "File of the certificate's private key (PEM)")
      ->envname("ISOMESH_TLS_KEY")
      ->needs(certificate);
}

void add_callback_options(CLI::App& cli, Options& options) {
  cli.add_option(
         "--callback-allow", options.callback_targets,
         "Allow callbacks to URLs that begin with this, such as https://ris.example.org/hooks. May "
         "be repeated. Prefix `private:` to allow private addresses")
      ->envname("ISOMESH_CALLBACK_ALLOW")
      ->type_name("URL")
      ->delimiter(',')
      ->allow_extra_args(false);
  cli.add_option("--callback-secret-file", options.callback_secrets,
                 "File of the keys that sign callbacks, one per line. SIGHUP reloads it")
      ->envname("ISOMESH_CALLBACK_SECRET_FILE");
  cli.add_option(
         "--callback-ca", options.callback_authorities,
         "File of the certificate authorities to trust for callbacks, instead of the system's")
      ->envname("ISOMESH_CALLBACK_CA");
  cli.add_option("--callback-retry-seconds", options.callback_retry_seconds,
                 "Seconds before a failed callback is retried; each further failure doubles them, "
                 "up to an hour")
      ->envname("ISOMESH_CALLBACK_RETRY_SECONDS")
      ->check(number_between(0.01, 3600.0))
      ->capture_default_str();
}

void add_blob_options(CLI::App& cli, Options& options) {
  cli.add_option("--blobs", options.blobs.place,
                 "Where to store the files of volumes and meshes, if not in the folder of --data: "
                 "s3://BUCKET[/PREFIX]?endpoint=URL&region=NAME, or a folder that several daemons "
                 "may share")
      ->envname("ISOMESH_BLOBS")
      ->type_name("URL|DIR");
  cli.add_option("--blob-cache", options.blobs.cache,
                 "Size of the cache for files from S3, in bytes; it is in the folder of --data")
      ->envname("ISOMESH_BLOB_CACHE")
      ->transform(size_of_bytes())
      ->capture_default_str();
  cli.add_option("--blob-credentials", options.blobs.credentials,
                 "File of the keys for S3, in the format of AWS' tools. Each S3 request reads it "
                 "again. Without it, AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are used")
      ->envname("ISOMESH_BLOB_CREDENTIALS");
  cli.add_option("--blob-ca", options.blobs.authorities,
                 "File of the certificate authorities to trust for S3, instead of the system's")
      ->envname("ISOMESH_BLOB_CA");
  cli.add_flag("--blob-redirect", options.http.blob_redirect,
               "Redirect mesh downloads that say `Prefer: redirect` to a link into S3, valid for "
               "one minute")
      ->envname("ISOMESH_BLOB_REDIRECT");
}

void add_check(CLI::App& cli, Options& options) {
  constexpr const char* kMeaning =
      "Check the options, print those that would be used, and exit; same as `isomeshd check`";
  cli.add_flag("--check-config", options.check_only, kMeaning)->configurable(false);
  cli.add_subcommand("check", "Check the options, print those that would be used, and exit")
      ->fallthrough()
      ->configurable(false)
      ->callback([&options] { options.check_only = true; });
}

// For a single start, so neither in a file nor in the environment.
void add_operator_overrides(CLI::App& cli, Options& options) {
  cli.add_flag("--adopt", options.overrides.adopt,
               "Start although the database and the files of volumes and meshes do not belong "
               "together. For this start only")
      ->configurable(false);
  cli.add_flag("--trust-clock", options.overrides.trust_clock,
               "Trust the clock although it is far ahead of the newest record. For this start only")
      ->configurable(false);
}

}  // namespace

void add_options(CLI::App& cli, Options& options) {
  cli.set_version_flag("--version", ISOMESH_VERSION);
  const char* config = std::getenv("ISOMESH_CONFIG");
  cli.set_config("--config", config == nullptr ? "" : config,
                 "Read options from this file (TOML); also ISOMESH_CONFIG", config != nullptr);
  cli.config_formatter(config_file(cli));
  cli.add_option("--listen", options.listen,
                 "Address to listen on: HOST:PORT, HOST:0 for a free port, or unix:PATH")
      ->envname("ISOMESH_LISTEN")
      ->capture_default_str();
  cli.add_option("--data", options.data, "Folder for volumes and meshes; created if missing")
      ->envname("ISOMESH_DATA")
      ->capture_default_str();
  cli.add_option("--store", options.store,
                 "PostgreSQL database that several daemons share, as postgresql://USER@HOST/NAME. "
                 "Without it, records are in SQLite in the folder of --data")
      ->envname("ISOMESH_STORE");
  cli.add_option(
         "--workers", options.workers,
         "Jobs to run at the same time. 0: this daemon runs no jobs and only answers requests")
      ->envname("ISOMESH_WORKERS")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  cli.add_option("--threads", options.threads, "Threads per job. 0: one per processor")
      ->envname("ISOMESH_THREADS")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  cli.add_option("--max-queue", options.jobs.max_queued,
                 "Jobs that may wait in the queue; further jobs are rejected with 503")
      ->envname("ISOMESH_MAX_QUEUE")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  cli.add_option("--keep-days", options.keep_days,
                 "Days to keep finished jobs with their meshes, and volumes after their last use")
      ->envname("ISOMESH_KEEP_DAYS")
      ->check(number_between(0.0, 100000.0))
      ->capture_default_str();
  cli.add_option("--max-disk", options.max_disk,
                 "Space for all volumes and meshes, in bytes. When it is full, isomeshd deletes "
                 "the oldest data of the largest user first. 0: the whole disk")
      ->envname("ISOMESH_MAX_DISK")
      ->transform(size_of_bytes())
      ->capture_default_str();
  cli.add_option("--disk-reserve", options.disk_reserve,
                 "Bytes to reserve so that a full disk can be cleaned up. Default: 1/32 of the "
                 "disk, at most 64 MiB")
      ->envname("ISOMESH_DISK_RESERVE")
      ->transform(size_of_bytes());
  cli.add_option("--lease-seconds", options.lease_seconds,
                 "Seconds without a sign of life after which a worker loses its job")
      ->envname("ISOMESH_LEASE_SECONDS")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  cli.add_option("--max-job-minutes", options.longest_job_minutes,
                 "Minutes that a job may run; a longer job fails")
      ->envname("ISOMESH_MAX_JOB_MINUTES")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  cli.add_option("--max-upload", options.http.upload.max_bytes,
                 "Largest size of one upload, in bytes")
      ->envname("ISOMESH_MAX_UPLOAD")
      ->transform(size_of_bytes(1))
      ->capture_default_str();
  cli.add_option("--upload-places", options.http.upload_places,
                 "Uploads to receive at the same time; one user or address may use at most half")
      ->envname("ISOMESH_UPLOAD_PLACES")
      ->check(CLI::Range(1, 24))
      ->capture_default_str();
  cli.add_option(
         "--cors-origin", options.http.cors_origins,
         "Origins whose pages may use this service, such as https://viewer.example; * allows all")
      ->envname("ISOMESH_CORS_ORIGIN")
      ->check(CLI::Validator(wrong_origin, ""))
      ->delimiter(',');
  cli.add_option("--allow-host", options.http.hosts,
                 "Host names that requests without tokens may use, besides loopback names")
      ->envname("ISOMESH_ALLOW_HOST")
      ->check(CLI::Validator(wrong_host, ""))
      ->delimiter(',');
  cli.add_option("--max-volume", options.import.max_sample_bytes,
                 "Largest size of one volume's uncompressed samples, in bytes")
      ->envname("ISOMESH_MAX_VOLUME")
      ->transform(size_of_bytes(1))
      ->capture_default_str();
  cli.add_option("--imports", options.runner.at_once,
                 "Uploads to read at the same time; others wait")
      ->envname("ISOMESH_IMPORTS")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  cli.add_option("--import-memory", options.runner.bounds.memory_bytes,
                 "Memory for reading one upload, in bytes, besides the volume itself")
      ->envname("ISOMESH_IMPORT_MEMORY")
      ->transform(size_of_bytes())
      ->check(CLI::Range(std::uint64_t{64} << 20, std::uint64_t{1} << 50))
      ->capture_default_str();
  cli.add_option("--import-seconds", options.import_seconds,
                 "Seconds that reading one upload may take")
      ->envname("ISOMESH_IMPORT_SECONDS")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  cli.add_option("--job-memory", options.job_memory,
                 "Memory for one job, in bytes. 0: three quarters of the memory of the machine or "
                 "control group, divided by --workers")
      ->envname("ISOMESH_JOB_MEMORY")
      ->transform(size_of_bytes())
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1} << 50))
      ->capture_default_str();
  cli.add_option("--drain-seconds", options.drain_seconds,
                 "Seconds that running jobs have to finish after SIGTERM. Less than what stops the "
                 "daemon waits: TimeoutStopSec= of systemd, --stop-timeout of Docker")
      ->envname("ISOMESH_DRAIN_SECONDS")
      ->capture_default_str();
  cli.add_flag("--open-network", options.open_network,
               "Listen beyond loopback although requests are not authenticated")
      ->envname("ISOMESH_OPEN_NETWORK");
  cli.add_option("--hospital", options.hospital,
                 "File of PACS and rules (TOML): orders fetch images from these PACS and send "
                 "meshes to them")
      ->envname("ISOMESH_HOSPITAL");
  add_log_options(cli, options);
  add_security_options(cli, options);
  add_callback_options(cli, options);
  add_blob_options(cli, options);
  add_operator_overrides(cli, options);
  add_check(cli, options);
}

std::vector<std::string> unknown_variables(const CLI::App& cli) {
  constexpr std::string_view kPrefix = "ISOMESH_";
  constexpr std::array<std::string_view, 3> kOfClients = {"ISOMESH_SERVER", "ISOMESH_TOKEN",
                                                          "ISOMESH_CA"};
  std::vector<std::string> known = {"ISOMESH_CONFIG"};
  for (const CLI::Option* option : cli.get_options()) known.push_back(option->get_envname());
  std::vector<std::string> warnings;
  for (char** variable = ::environ; *variable != nullptr; ++variable) {
    const std::string_view entry = *variable;
    const std::string name(entry.substr(0, entry.find('=')));
    if (!name.starts_with(kPrefix) || std::ranges::find(known, name) != known.end() ||
        std::ranges::find(kOfClients, name) != kOfClients.end()) {
      continue;
    }
    const std::string close = command_line::closest_to(name, known);
    warnings.push_back("there is no option " + name + " in the environment, so it is ignored" +
                       (close.empty() ? "" : ". Did you mean " + close + '?'));
  }
  return warnings;
}

std::string as_config(const CLI::App& cli, Remarks remarks) {
  std::string text;
  if (remarks == Remarks::kYes) {
    text =
        "# Options of isomeshd with their defaults; see isomeshd(8). The command line and the "
        "environment\n# override them. `isomeshd check --config FILE` prints the options that "
        "would be used.\n\n";
  }
  for (const CLI::Option* option : cli.get_options()) {
    if (!option->get_configurable() || option->get_lnames().empty()) continue;
    const std::string value = value_of(*option);
    // An empty value without a default is none.
    const bool is_set =
        option->count() > 0 && !(value.empty() && option->get_default_str().empty());
    if (remarks == Remarks::kYes) text += "# " + option->get_description() + ".\n";
    text += (is_set ? "" : "# ") + option->get_lnames().front();
    text += " = " + as_toml(*option, value) + '\n';
    if (remarks == Remarks::kYes) text += '\n';
  }
  return text;
}

}  // namespace isomesh
