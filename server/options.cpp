#include "server/options.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/command_line/closest.h"
#include "base/text.h"
#include "server/config_file.h"
#include "server/http/guards/origin.h"
#include "server/wings.h"

namespace isomesh {
namespace {

const std::map<std::string, LogLevel> kLogLevels = {{"debug", LogLevel::kDebug},
                                                    {"info", LogLevel::kInfo},
                                                    {"warn", LogLevel::kWarn},
                                                    {"error", LogLevel::kError},
                                                    {"off", LogLevel::kOff}};
const std::map<std::string, LogFormat> kLogFormats = {{"text", LogFormat::kText},
                                                      {"json", LogFormat::kJson}};
const std::map<std::string, http::ClientHeader> kProxyHeaders = {
    {"forwarded", http::ClientHeader::kForwarded},
    {"x-forwarded-for", http::ClientHeader::kXForwardedFor}};

// The library stores an enumerator's number instead of its name.
template <class Enum>
std::string name_in(const std::map<std::string, Enum>& names, const std::string& number) {
  for (const auto& [name, value] : names) {
    if (std::to_string(static_cast<int>(value)) == number) return name;
  }
  return number;
}

// No values if the option has no default either.
std::vector<std::string> values_of(const CLI::Option& option) {
  const bool is_flag = option.get_expected_max() == 0;
  if (option.count() == 0) {
    const std::string standard = is_flag ? "false" : option.get_default_str();
    return standard.empty() ? std::vector<std::string>() : std::vector{standard};
  }
  std::vector<std::string> values = option.reduced_results();
  const std::string& name = option.get_lnames().front();
  for (std::string& value : values) {
    if (name == "log-level") value = name_in(kLogLevels, value);
    if (name == "log-format") value = name_in(kLogFormats, value);
    if (name == "proxy-header") value = name_in(kProxyHeaders, value);
  }
  std::erase(values, "");
  return values;
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
  const bool is_name = text.find_first_of(" \t/") == std::string::npos;
  return is_name && !http::host_named(text).empty() ? "" : '"' + text + "\" is not a host name";
}

std::string wrong_proxy(const std::string& text) {
  try {
    http::TrustedProxies({text}, {});
    return "";
  } catch (const Error& error) {
    return text + ": " + error.what();
  }
}

// Restricts the values of an option.
using Limits = std::function<void(CLI::Option&)>;

template <class Number>
Limits between(Number least, Number most) {
  if constexpr (std::is_floating_point_v<Number>) {
    return [=](CLI::Option& option) { option.check(number_between(least, most)); };
  } else {
    return [=](CLI::Option& option) { option.check(CLI::Range(least, most)); };
  }
}

Limits bytes(std::uint64_t least = 0) {
  return [=](CLI::Option& option) { option.transform(size_of_bytes(least)); };
}

Limits bytes_between(std::uint64_t least, std::uint64_t most) {
  return [=](CLI::Option& option) {
    option.transform(size_of_bytes())->check(CLI::Range(least, most));
  };
}

template <class Enum>
Limits one_name_of(const std::map<std::string, Enum>& names, const char* standard) {
  return [&names, standard](CLI::Option& option) {
    option.transform(one_of(names))->default_str(standard);
  };
}

// Each time that the option is given, it has values separated by commas. No value has one.
Limits many(std::string (*fault_of)(const std::string&)) {
  return [=](CLI::Option& option) {
    option.check(CLI::Validator(fault_of, ""))->delimiter(',')->allow_extra_args(false);
  };
}

Limits typed(const char* type) {
  return [=](CLI::Option& option) { option.type_name(type); };
}

// Each time that the option is given, it has one value, which may have commas, as distinguished
// names and URLs do. A variable of the environment has one value a line.
Limits repeated(const char* type) {
  return [=](CLI::Option& option) {
    option.type_name(type)->delimiter('\n')->allow_extra_args(false);
  };
}

void no_limits(CLI::Option& /*option*/) {}

// An option without its hyphens, which is also the key in the file of --config. Its variable in the
// environment is ISOMESH_MAX_QUEUE for max-queue. Its default is the member's.
struct Row {
  template <class T>
  Row(const char* option, T& member, Limits bounds, const char* meaning)
      : name(option), help(meaning), limits(std::move(bounds)) {
    add = [&member](CLI::App& cli, const std::string& flag, const char* text) -> CLI::Option& {
      if constexpr (std::is_same_v<T, bool>) {
        return *cli.add_flag(flag, member, text);
      } else {
        CLI::Option& added = *cli.add_option(flag, member, text);
        constexpr bool kHasDefault = !std::is_same_v<T, std::vector<std::string>> &&
                                     !std::is_same_v<T, std::optional<std::uint64_t>>;
        if constexpr (kHasDefault && !std::is_enum_v<T>) added.capture_default_str();
        return added;
      }
    };
  }

  const char* name;
  const char* help;
  Limits limits;
  std::function<CLI::Option&(CLI::App&, const std::string&, const char*)> add;
};

std::string variable_of(std::string name) {
  std::ranges::replace(name, '-', '_');
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::toupper(c); });
  return "ISOMESH_" + name;
}

std::vector<Row> rows_of(Options& options) {
  return {
      {"listen", options.listen, no_limits,
       "Address to listen on: HOST:PORT, HOST:0 for a free port, or unix:PATH"},
      {"data", options.data, no_limits, "Folder for volumes and meshes; created if missing"},
      {"store", options.store, no_limits,
       "PostgreSQL database that several daemons share, as postgresql://USER@HOST/NAME. "
       "Without it, records are in SQLite in the folder of --data"},
      {"workers", options.workers, between(0, 64),
       "Jobs to run at the same time. 0: this daemon runs no jobs and only answers requests"},
      {"threads", options.threads, between(0, 1024), "Threads per job. 0: one per processor"},
      {"max-queue", options.jobs.max_queued, between(1, 1000000),
       "Jobs that may wait in the queue; further jobs are rejected with 503"},
      {"keep-days", options.keep_days, between(0.0, 100000.0),
       "Days to keep finished jobs with their meshes, and volumes after their last use"},
      {"max-disk", options.max_disk, bytes(),
       "Space for all volumes and meshes, in bytes. When it is full, isomeshd deletes "
       "the oldest data of the largest user first. 0: the whole disk"},
      {"disk-reserve", options.disk_reserve, bytes(),
       "Bytes to reserve so that a full disk can be cleaned up. Default: 1/32 of the "
       "disk, at most 64 MiB"},
      {"lease-seconds", options.lease_seconds, between(1, 3600),
       "Seconds without a sign of life after which a worker loses its job"},
      {"max-job-minutes", options.longest_job_minutes, between(1, 10000),
       "Minutes that a job may run; a longer job fails"},
      {"max-upload", options.http.upload.max_bytes, bytes(1),
       "Largest size of one upload, in bytes"},
      {"upload-places", options.http.upload_places, between(1, 24),
       "Uploads to receive at the same time; one user or address may use at most half"},
      {"cors-origin", options.http.cors_origins, many(wrong_origin),
       "Origins whose pages may use this service, such as https://viewer.example; * allows all"},
      {"allow-host", options.http.hosts, many(wrong_host),
       "Host names that requests without tokens may use, besides loopback names"},
      {"trusted-proxy", options.http.trusted_proxies, many(wrong_proxy),
       "Reverse proxies whose header names the address of a client: addresses, networks such as "
       "10.1.0.0/16, or unix for the clients of a Unix socket"},
      {"proxy-header", options.http.proxy_header, one_name_of(kProxyHeaders, "x-forwarded-for"),
       "The header in which those proxies name clients: x-forwarded-for or forwarded"},
      {"max-volume", options.import.max_sample_bytes, bytes(1),
       "Largest size of one volume's uncompressed samples, in bytes"},
      {"imports", options.runner.at_once, between(1, 64),
       "Uploads to read at the same time; others wait"},
      {"import-memory", options.runner.bounds.memory_bytes,
       bytes_between(std::uint64_t{64} << 20, std::uint64_t{1} << 50),
       "Memory for reading one upload, in bytes, besides the volume itself"},
      {"import-seconds", options.import_seconds, between(1, 86400),
       "Seconds that reading one upload may take"},
      {"job-memory", options.job_memory, bytes_between(std::uint64_t{0}, std::uint64_t{1} << 50),
       "Memory for one job, in bytes. 0: three quarters of the memory of the machine or "
       "control group, divided by --workers"},
      {"drain-seconds", options.drain_seconds, no_limits,
       "Seconds that running jobs have to finish after SIGTERM. Less than what stops the "
       "daemon waits: TimeoutStopSec= of systemd, --stop-timeout of Docker"},
      {"open-network", options.open_network, no_limits,
       "Listen beyond loopback although requests are not authenticated"},
      {wing_entry().option.c_str(), options.wing, no_limits, wing_entry().help.c_str()},
      {"log-level", options.log_level, one_name_of(kLogLevels, "info"),
       "Least severe messages to log: debug, info, warn, error or off"},
      {"log-format", options.log_format, one_name_of(kLogFormats, "text"),
       "Format of the log lines on standard error: text or json"},
      {"tokens", options.tokens, no_limits,
       "File of the tokens that requests need; `isomeshd token add` creates them. SIGHUP "
       "reloads it"},
      {"oidc-issuer", options.provider.issuer, typed("URL"),
       "Login provider (OpenID Connect), such as https://login.example/realms/hospital. Its tokens "
       "are accepted beside those of --tokens"},
      {"oidc-audience", options.provider.audience, no_limits,
       "Audience that tokens of the login provider must be for"},
      {"oidc-client-id", options.provider.client_id, no_limits,
       "Name of the web page at the login provider. Without it, the page has no login"},
      {"oidc-role-claim", options.provider.role_claim, no_limits,
       "Member of such tokens that lists the roles of a person, such as realm_access.roles"},
      {"oidc-role", options.provider.roles, repeated("VALUE=ROLE"),
       "Role user, admin or monitor of persons with this value in that list. May be repeated; * "
       "stands for everybody. Default: isomesh-user=user, isomesh-admin=admin and "
       "isomesh-monitor=monitor"},
      {"oidc-parameter", options.provider.parameters, repeated("NAME=VALUE"),
       "Parameter that the page adds to its login, such as scope=openid api://isomesh/.default, "
       "resource=URL or audience=NAME. May be repeated"},
      {"oidc-ca", options.provider.authorities, no_limits,
       "File of the certificate authorities to trust for the login provider, instead of the "
       "system's"},
      {"tls-cert", options.tls_certificate, no_limits,
       "Certificate file (PEM), to listen with https. SIGHUP reloads it and the key"},
      {"tls-key", options.tls_key, no_limits, "File of the certificate's private key (PEM)"},
      {"callback-allow", options.callback_targets, repeated("URL"),
       "Allow callbacks to URLs that begin with this, such as https://ris.example.org/hooks. May "
       "be repeated. Prefix `private:` to allow private addresses"},
      {"callback-secret-file", options.callback_secrets, no_limits,
       "File of the keys that sign callbacks, one per line. SIGHUP reloads it"},
      {"callback-ca", options.callback_authorities, no_limits,
       "File of the certificate authorities to trust for callbacks, instead of the system's"},
      {"callback-retry-seconds", options.callback_retry_seconds, between(0.01, 3600.0),
       "Seconds before a failed callback is retried; each further failure doubles them, "
       "up to an hour"},
      {"blobs", options.blobs.place, typed("URL|DIR"),
       "Where to store the files of volumes and meshes, if not in the folder of --data: "
       "s3://BUCKET[/PREFIX]?endpoint=URL&region=NAME, or a folder that several daemons "
       "may share"},
      {"blob-cache", options.blobs.cache, bytes(),
       "Size of the cache for files from S3, in bytes; it is in the folder of --data"},
      {"blob-credentials", options.blobs.credentials, no_limits,
       "File of the keys for S3, in the format of AWS' tools. Each S3 request reads it "
       "again. Without it, AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are used"},
      {"blob-ca", options.blobs.authorities, no_limits,
       "File of the certificate authorities to trust for S3, instead of the system's"},
      {"blob-redirect", options.http.blob_redirect, no_limits,
       "Redirect mesh downloads that say `Prefer: redirect` to a link into S3, valid for "
       "one minute"},
  };
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
  for (const Row& row : rows_of(options)) {
    CLI::Option& added = row.add(cli, std::string("--") + row.name, row.help);
    added.envname(variable_of(row.name));
    row.limits(added);
  }
  cli.get_option("--tls-key")->needs("--tls-cert");
  for (const char* name :
       {"--oidc-audience", "--oidc-client-id", "--oidc-role", "--oidc-parameter", "--oidc-ca"}) {
    cli.get_option(name)->needs("--oidc-issuer");
  }
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
    const std::vector<std::string> values = values_of(*option);
    // An empty value without a default is none.
    const bool is_set =
        option->count() > 0 && !(values.empty() && option->get_default_str().empty());
    if (remarks == Remarks::kYes) text += "# " + option->get_description() + ".\n";
    text += (is_set ? "" : "# ") + option->get_lnames().front();
    text += " = " + as_toml(*option, values) + '\n';
    if (remarks == Remarks::kYes) text += '\n';
  }
  return text;
}

}  // namespace isomesh
