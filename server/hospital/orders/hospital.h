// What the file of --hospital says: PACS, rules, and how patient orders are.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/orders.h"

namespace isomesh::orders {

// How objects are sent.
enum class SendBy { kStow, kCStore };

// A PACS that is spoken to by DICOMweb (PS3.18), and sent to by that or by DIMSE (PS3.7).
struct PacsSettings {
  std::string name;      // what requests call it
  std::string dicomweb;  // URL below which /studies is; empty: it is only sent to, by C-STORE
  std::string user;      // empty: none
  std::filesystem::path password_file;
  std::filesystem::path token_file;  // of a bearer token
  std::filesystem::path ca_file;     // empty: the system's authorities
  std::chrono::seconds timeout{30};  // without a byte
  std::string transfer_syntax = "*";
  SendBy send_by = SendBy::kStow;
  std::string aet;  // of C-STORE: its title, ours, and where it listens
  std::string calling_aet = "ISOMESH";
  std::string host;
  std::uint16_t port = 0;
  std::uint64_t max_send_bytes = 4'000'000'000;
  std::vector<std::string> owners;  // who may order from it without a rule; empty: everybody
};

// Which series a watch takes. What is empty does not matter.
struct SeriesMatch {
  std::string modality;
  std::string series_description;  // * stands for any text, ? for one character; in any case
  std::uint32_t min_instances = 1;
  std::uint32_t days = 2;  // of studies of today and so many days before
};

struct Rule {
  std::string name;
  std::string owner;  // the name of the token that its orders belong to
  std::string label;  // what its meshes are called
  std::int64_t series_number = 9001;
  std::optional<std::string> watch;  // the PACS that is asked for new series
  SeriesMatch match;
  // What an object that is too large for its PACS may be simplified by; empty: it fails.
  std::optional<double> max_error_mm;
  std::string parameters;  // of its jobs: JSON, as parse_order_parameters takes it
  std::vector<SendTarget> send;
};

// Where series are received by C-STORE, and from whom.
struct DimseSettings {
  std::string listen;                         // HOST:PORT
  std::size_t associations = 8;               // at the same time; further ones wait
  std::map<std::string, std::string> routes;  // rules by the titles that series are sent to
  std::vector<std::string> calling;           // titles that may send
  std::chrono::seconds idle{60};              // without a byte
  std::uint64_t max_object_bytes = std::uint64_t{4} << 30;
  std::uint64_t max_held_bytes = std::uint64_t{100} << 30;  // of all that orders do not have yet
};

// Where the audit trail is sent, as syslog over TLS (RFC 5425).
struct SyslogSettings {
  std::string host;
  std::uint16_t port = 6514;
  std::filesystem::path ca_file;           // empty: the system's authorities
  std::filesystem::path certificate_file;  // ours; empty: none
  std::filesystem::path key_file;
};

struct Hospital {
  std::chrono::seconds settle{60};  // the list of a series' instances is unchanged for so long
  std::chrono::seconds poll{30};
  std::chrono::seconds first_delay{5};  // after a failed attempt; doubles
  std::chrono::seconds longest_delay{std::chrono::hours(1)};
  std::chrono::seconds give_up{std::chrono::hours(72)};
  std::size_t most_open = 10'000;  // orders
  std::string station_name = "isomesh";
  std::vector<PacsSettings> pacs;
  std::vector<Rule> rules;
  std::optional<DimseSettings> dimse;
  std::optional<SyslogSettings> syslog;

  // Null when there is none of that name.
  const PacsSettings* find_pacs(std::string_view name) const;
  const Rule* find_rule(std::string_view name) const;
};

// Reads TOML. Throws Error kInvalidParameter, without the value, that names the key which is
// unknown, missing, of the wrong type or out of range, or the line that is no TOML.
Hospital read_hospital(const std::filesystem::path& file);
Hospital parse_hospital(std::string_view toml);

// Whether a text is what the pattern stands for: see SeriesMatch.
bool matches(std::string_view pattern, std::string_view text);

}  // namespace isomesh::orders
