#include "server/hospital/orders/settings.h"

#include <algorithm>
#include <limits>
#include <set>
#include <sstream>

#include <toml++/toml.h>

#include "base/files.h"
#include "base/text.h"
#include "proto/dicom_uid.h"
#include "proto/error.h"
#include "server/hospital/dimse/message.h"
#include "server/hospital/orders/section.h"
#include "server/hospital/records/order_store.h"

namespace isomesh::orders {
namespace {

using std::chrono::seconds;

// As an order may wait for the longest of these times.
constexpr std::int64_t kMostSeconds = seconds(store::kLongestWait).count();

// Reads a text that becomes the value of a DICOM element with the value representation LO.
void read_long_string(Section& section, std::string_view key, std::string& text) {
  constexpr std::size_t kLongest = 64;
  section.read(key, text);
  if (text.size() > kLongest || text.find('\\') != std::string::npos) {
    refuse(section.key_of(key), "must have at most 64 characters and no backslash");
  }
}

void read_orders(Section section, HospitalSettings& settings) {
  section.read("settle-seconds", settings.settle, 0, kMostSeconds);
  section.read("poll-seconds", settings.poll, 1, kMostSeconds);
  section.read("first-delay-seconds", settings.first_delay, 1, kMostSeconds);
  section.read("max-open", settings.most_open, 1, 1'000'000);
  std::int64_t hours = std::chrono::duration_cast<std::chrono::hours>(settings.give_up).count();
  section.read("give-up-hours", hours, 1, 24 * 365);
  settings.give_up = std::chrono::hours(hours);
  read_long_string(section, "station-name", settings.station_name);
  section.finish();
}

void check_name(const Section& section, const std::string& name) {
  constexpr std::size_t kLongest = 40;
  section.require("name", name);
  if (name.size() > kLongest || !std::ranges::all_of(name, is_plain)) {
    refuse(section.key_of("name"),
           "must have at most 40 characters: letters, digits, dots, dashes and underscores");
  }
}

void check_title(const std::string& key, const std::string& title) {
  if (!dimse::is_ae_title(title)) {
    refuse(key, "must be 1 to 16 printable ASCII characters without a backslash");
  }
}

// Reads a certificate and its key, of which neither works without the other.
void read_certificate(Section& section, std::filesystem::path& certificate,
                      std::filesystem::path& key) {
  section.read("certificate-file", certificate);
  section.read("key-file", key);
  if (certificate.empty() != key.empty()) {
    refuse(section.key_of("certificate-file"), "must be given together with key-file");
  }
}

void read_tls(Section& section, PacsSettings& pacs) {
  section.read("tls", pacs.tls);
  section.read("certificate-name", pacs.certificate_name);
  read_certificate(section, pacs.certificate_file, pacs.key_file);
  if (pacs.tls) {
    if (pacs.send_by != SendBy::kCStore) {
      refuse(section.key_of("tls"), "is for send-by = \"c-store\"; dicomweb has https://");
    }
    if (pacs.certificate_name == "*" && pacs.ca_file.empty()) {
      refuse(section.key_of("certificate-name"),
             "\"*\" needs ca-file: any server has a certificate of the system's authorities");
    }
    return;
  }
  if (!pacs.certificate_name.empty() || !pacs.certificate_file.empty()) {
    refuse(section.key_of("tls"), "must be true if certificate-name or certificate-file is given");
  }
}

void read_send_by(Section& section, PacsSettings& pacs) {
  std::string send_by = "stow";
  section.read("send-by", send_by);
  section.read("aet", pacs.aet);
  section.read("calling-aet", pacs.calling_aet);
  section.read("host", pacs.host);
  section.read("port", pacs.port, 1, 65535);
  if (send_by == "c-store") {
    pacs.send_by = SendBy::kCStore;
    for (const auto& [key, value] : {std::pair("aet", pacs.aet), std::pair("host", pacs.host)}) {
      section.require(key, value);
    }
    if (pacs.port == 0) refuse(section.key_of("port"), "is required");
    check_title(section.key_of("aet"), pacs.aet);
    check_title(section.key_of("calling-aet"), pacs.calling_aet);
    return;
  }
  if (send_by != "stow") refuse(section.key_of("send-by"), "must be \"stow\" or \"c-store\"");
  if (!pacs.aet.empty() || !pacs.host.empty() || pacs.port != 0) {
    refuse(section.key_of("send-by"), "must be \"c-store\" if aet, host or port is given");
  }
  section.require("dicomweb", pacs.dicomweb);
}

PacsSettings read_pacs(Section section) {
  PacsSettings pacs;
  section.read("name", pacs.name);
  check_name(section, pacs.name);
  section.read("dicomweb", pacs.dicomweb);
  if (!pacs.dicomweb.empty() && !pacs.dicomweb.starts_with("http://") &&
      !pacs.dicomweb.starts_with("https://")) {
    refuse(section.key_of("dicomweb"), "must be an http or https URL");
  }
  while (pacs.dicomweb.ends_with('/')) pacs.dicomweb.pop_back();
  section.read("user", pacs.user);
  section.read("password-file", pacs.password_file);
  section.read("token-file", pacs.token_file);
  if (pacs.user.empty() != pacs.password_file.empty()) {
    refuse(section.key_of("user"), "must be given together with password-file");
  }
  if (!pacs.user.empty() && !pacs.token_file.empty()) {
    refuse(section.key_of("token-file"), "cannot be combined with user");
  }
  section.read("ca-file", pacs.ca_file);
  section.read("timeout-seconds", pacs.timeout, 1, 3600);
  section.read("transfer-syntax", pacs.transfer_syntax);
  if (pacs.transfer_syntax != "*" && !is_uid(pacs.transfer_syntax)) {
    refuse(section.key_of("transfer-syntax"), "must be * or the UID of a transfer syntax");
  }
  read_send_by(section, pacs);
  read_tls(section, pacs);
  section.read("max-send-bytes", pacs.max_send_bytes, 1, 4'294'967'294);
  section.read("owners", pacs.owners);
  section.finish();
  return pacs;
}

SeriesMatch read_match(Section section) {
  SeriesMatch match;
  section.read("modality", match.modality);
  section.read("series-description", match.series_description);
  section.read("min-instances", match.min_instances, 1, 100'000);
  section.read("days", match.days, 0, 3650);
  section.finish();
  return match;
}

std::vector<SendTarget> read_send(Section& rule) {
  std::vector<SendTarget> targets;
  for (Section section : rule.sections("send")) {
    SendTarget target;
    section.read("pacs", target.pacs);
    section.require("pacs", target.pacs);
    std::string format = "stl";
    section.read("format", format);
    const auto known = from_string<SendFormat>(format);
    if (!known) refuse(section.key_of("format"), "must be " + names_of<SendFormat>());
    target.format = *known;
    section.finish();
    targets.push_back(std::move(target));
  }
  return targets;
}

std::string as_json(const toml::table& table) {
  std::ostringstream text;
  text << toml::json_formatter(
      table, toml::json_formatter::default_flags & ~toml::format_flags::quote_infinities_and_nans);
  return text.str();
}

void read_worklist(Section& section, Rule& rule) {
  std::string worklist;
  section.read("worklist", worklist);
  section.read("procedures", rule.procedures);
  section.read("images", rule.images);
  if (worklist.empty()) {
    if (rule.procedures.empty() && rule.images.empty()) return;
    refuse(section.key_of("worklist"), "is required if procedures or images is given");
  }
  rule.worklist = worklist;
  if (rule.images.empty()) rule.images = worklist;
  const auto is_code = [](const std::string& code) {
    const std::size_t caret = code.find('^');
    return caret != std::string::npos && caret > 0 && caret + 1 < code.size() &&
           code.find('^', caret + 1) == std::string::npos && !has_control_characters(code);
  };
  if (rule.procedures.empty() || !std::ranges::all_of(rule.procedures, is_code)) {
    refuse(section.key_of("procedures"),
           "must be a list of codes, each \"VALUE^SCHEME\" as in \"MESH^99HOSP\"");
  }
}

Rule read_rule(Section section) {
  Rule rule;
  section.read("name", rule.name);
  check_name(section, rule.name);
  section.read("owner", rule.owner);
  rule.label = rule.name;
  read_long_string(section, "label", rule.label);
  section.read("series-number", rule.series_number, 0, std::numeric_limits<std::int32_t>::max());
  section.read("max-error-mm", rule.max_error_mm);
  std::string watch;
  section.read("watch", watch);
  if (!watch.empty()) rule.watch = watch;
  read_worklist(section, rule);
  if (auto match = section.section("match")) rule.match = read_match(std::move(*match));
  if (auto parameters = section.section("parameters")) {
    rule.parameters = as_json(parameters->table());
    parse_order_parameters(rule.parameters, "", parameters->key_of(""));
  } else {
    refuse(section.key_of("parameters"), "is required");
  }
  rule.send = read_send(section);
  if (rule.send.empty()) refuse(section.key_of("send"), "is required");
  section.finish();
  return rule;
}

void read_encryption(Section& section, DimseSettings& dimse) {
  read_certificate(section, dimse.certificate_file, dimse.key_file);
  section.read("ca-file", dimse.ca_file);
  if (!dimse.ca_file.empty() && dimse.certificate_file.empty()) {
    refuse(section.key_of("ca-file"), "is for TLS, which needs certificate-file and key-file");
  }
  auto names = section.section("certificate-names");
  if (!names) return;
  if (dimse.ca_file.empty()) {
    refuse(section.key_of("certificate-names"), "needs ca-file, the authorities of certificates");
  }
  for (const auto& [title, unused] : names->table()) {
    const std::string calling(title.str());
    if (std::ranges::find(dimse.calling, calling) == dimse.calling.end()) {
      refuse(names->key_of(calling), "is not a title in calling");
    }
    names->read(calling, dimse.certificate_names[calling]);
    names->require(calling, dimse.certificate_names[calling]);
  }
}

DimseSettings read_dimse(Section section) {
  DimseSettings dimse;
  section.read("listen", dimse.listen);
  section.require("listen", dimse.listen);
  section.read("associations", dimse.associations, 1, 64);
  section.read("idle-seconds", dimse.idle, 1, 3600);
  constexpr std::int64_t kMostBytes = std::int64_t{1} << 50;
  section.read("max-object-bytes", dimse.max_object_bytes, 1, kMostBytes);
  section.read("max-held-bytes", dimse.max_held_bytes, 1, kMostBytes);
  section.read("calling", dimse.calling);
  for (const std::string& title : dimse.calling) check_title(section.key_of("calling"), title);
  if (dimse.calling.empty())
    refuse(section.key_of("calling"), "is required: without it, nobody may send");
  auto routes = section.section("routes");
  if (!routes || routes->table().empty()) refuse(section.key_of("routes"), "is required");
  for (const auto& [title, unused] : routes->table()) {
    check_title(routes->key_of(title.str()), std::string(title.str()));
    routes->read(title.str(), dimse.routes[std::string(title.str())]);
  }
  read_encryption(section, dimse);
  section.finish();
  return dimse;
}

// Reads HOST or HOST:PORT, with brackets around an IPv6 address that are no part of the host.
// Returns false for anything else.
bool read_authority(std::string_view text, SyslogSettings& syslog) {
  const bool has_brackets = text.starts_with('[');
  const std::size_t colon = text.rfind(':');
  const std::size_t end = has_brackets ? text.find(']') : std::min(colon, text.size());
  if (end == text.npos) return false;
  syslog.host = text.substr(0, end).substr(has_brackets ? 1 : 0);
  const std::string_view rest = text.substr(end + (has_brackets ? 1 : 0));
  if (syslog.host.empty() || rest.empty()) return !syslog.host.empty();
  const auto port = rest.starts_with(':') ? parse_uint64(rest.substr(1)) : std::nullopt;
  if (!port || *port == 0 || *port > 65535) return false;
  syslog.port = static_cast<std::uint16_t>(*port);
  return true;
}

std::optional<SyslogSettings> read_audit(Section section) {
  SyslogSettings syslog;
  std::string url;
  section.read("syslog", url);
  section.read("ca-file", syslog.ca_file);
  read_certificate(section, syslog.certificate_file, syslog.key_file);
  section.finish();
  section.require("syslog", url);
  constexpr std::string_view kScheme = "tls://";
  if (!url.starts_with(kScheme) ||
      !read_authority(std::string_view(url).substr(kScheme.size()), syslog)) {
    refuse(section.key_of("syslog"), "must be tls://HOST or tls://HOST:PORT");
  }
  return syslog;
}

WorklistSettings read_own_worklist(Section section) {
  WorklistSettings worklist;
  section.read("requesters", worklist.requesters);
  section.read("performers", worklist.performers);
  section.read("max-workitems", worklist.most, 1, 100'000);
  section.finish();
  return worklist;
}

bool is_route(const HospitalSettings& settings, const std::string& rule) {
  return settings.dimse && std::ranges::any_of(settings.dimse->routes, [&](const auto& route) {
           return route.second == rule;
         });
}

// Checks that names are unique and that all references exist.
void check_names(const HospitalSettings& settings) {
  std::set<std::string> names;
  for (const PacsSettings& pacs : settings.pacs) {
    if (!names.insert(pacs.name).second)
      refuse("pacs.name", "\"" + pacs.name + "\" is given twice");
  }
  std::set<std::string> rules;
  for (const Rule& rule : settings.rules) {
    if (!rules.insert(rule.name).second) {
      refuse("rules.name", "\"" + rule.name + "\" is given twice");
    }
    const bool is_segmented =
        std::ranges::find(rule.send, SendFormat::kSeg, &SendTarget::format) != rule.send.end();
    const bool is_automatic = rule.watch || rule.worklist || is_route(settings, rule.name);
    if (is_segmented && is_automatic) {
      refuse("rules." + rule.name + ".send",
             "cannot have the format \"seg\": only a request can name a label volume");
    }
    std::vector<std::string> used;
    if (rule.watch) used.push_back(*rule.watch);
    if (rule.worklist) {
      used.push_back(*rule.worklist);
      used.push_back(rule.images);
    }
    for (const SendTarget& target : rule.send) used.push_back(target.pacs);
    for (const std::string& name : used) {
      if (names.contains(name)) continue;
      refuse("rules." + rule.name, "names the PACS \"" + name + "\", which is not configured");
    }
    if (rule.watch && settings.find_pacs(*rule.watch)->dicomweb.empty()) {
      refuse("rules." + rule.name + ".watch", "names a PACS without dicomweb");
    }
    if (rule.worklist && (settings.find_pacs(*rule.worklist)->dicomweb.empty() ||
                          settings.find_pacs(rule.images)->dicomweb.empty())) {
      refuse("rules." + rule.name + ".worklist", "and images must name PACS with dicomweb");
    }
  }
  if (!settings.dimse) return;
  for (const auto& [title, rule] : settings.dimse->routes) {
    if (!rules.contains(rule)) {
      refuse("dimse.routes." + title, "names the rule \"" + rule + "\", which is not configured");
    }
  }
}

HospitalSettings settings_of(const toml::table& table) {
  HospitalSettings settings;
  Section all(table, "");
  if (auto orders = all.section("orders")) read_orders(std::move(*orders), settings);
  for (Section& section : all.sections("pacs")) settings.pacs.push_back(read_pacs(section));
  for (Section& section : all.sections("rules")) settings.rules.push_back(read_rule(section));
  if (auto dimse = all.section("dimse")) settings.dimse = read_dimse(std::move(*dimse));
  if (auto audit = all.section("audit")) settings.syslog = read_audit(std::move(*audit));
  if (auto own = all.section("worklist")) settings.worklist = read_own_worklist(std::move(*own));
  all.finish();
  if (settings.pacs.empty() && !settings.worklist) {
    refuse("pacs", "is required: orders need a PACS");
  }
  check_names(settings);
  return settings;
}

}  // namespace

const PacsSettings* HospitalSettings::find_pacs(std::string_view name) const {
  const auto found = std::ranges::find(pacs, name, &PacsSettings::name);
  return found == pacs.end() ? nullptr : &*found;
}

const Rule* HospitalSettings::find_rule(std::string_view name) const {
  const auto found = std::ranges::find(rules, name, &Rule::name);
  return found == rules.end() ? nullptr : &*found;
}

HospitalSettings parse_settings(std::string_view toml) {
  try {
    return settings_of(toml::parse(toml));
  } catch (const toml::parse_error& error) {
    throw Error(ErrorCode::kInvalidParameter, "the file of --hospital: line " +
                                                  std::to_string(error.source().begin.line) + ": " +
                                                  std::string(error.description()));
  } catch (const Error& error) {
    throw error.with_detail(std::string("the file of --hospital: ") + error.what());
  }
}

HospitalSettings read_settings(const std::filesystem::path& file) {
  const InputFile input = InputFile::chosen(file);
  return parse_settings(input.text(0, static_cast<std::size_t>(input.size())));
}

}  // namespace isomesh::orders
