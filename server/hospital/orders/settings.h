// The configuration in the file of --hospital: PACS, rules, and defaults for orders.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/hospital/protocol/orders.h"

namespace isomesh::orders {

enum class SendBy { kStow, kCStore };

// A PACS that is queried by DICOMweb (PS3.18), and receives by DICOMweb or DIMSE (PS3.7).
struct PacsSettings {
  std::string name;      // used in requests
  std::string dicomweb;  // base URL of /studies; empty: only receives, by C-STORE
  std::string user;      // empty: none
  std::filesystem::path password_file;
  std::filesystem::path token_file;  // contains a bearer token
  std::filesystem::path ca_file;     // empty: the system's authorities
  std::chrono::seconds timeout{30};  // without any byte
  std::string transfer_syntax = "*";
  SendBy send_by = SendBy::kStow;
  std::string aet;  // for C-STORE: its AE title, ours, and its address
  std::string calling_aet = "ISOMESH";
  std::string host;
  std::uint16_t port = 0;
  bool tls = false;                        // for C-STORE, as the next three
  std::string certificate_name;            // that the PACS must have; empty: the host, "*": any
  std::filesystem::path certificate_file;  // client certificate; empty: none
  std::filesystem::path key_file;
  std::uint64_t max_send_bytes = 4'000'000'000;
  std::vector<std::string> owners;  // may order from it without a rule; empty: everybody
};

// Selects series for a watch. Empty fields match everything.
struct SeriesMatch {
  std::string modality;
  std::string series_description;  // * matches any text, ? one character; ignores case
  std::uint32_t min_instances = 1;
  std::uint32_t days = 2;  // studies of today and this many days before
};

struct Rule {
  std::string name;
  std::string owner;  // name of the token that owns its orders
  std::string label;  // name of its meshes
  std::int64_t series_number = 9001;
  std::optional<std::string> watch;     // the PACS to query for new series
  std::optional<std::string> worklist;  // the PACS whose workitems it performs
  std::vector<std::string> procedures;  // their codes, VALUE^SCHEME
  std::string images;                   // the PACS with the images of the workitems
  SeriesMatch match;
  // Largest error of simplifying a mesh that is too large for its PACS; empty: such an order fails.
  std::optional<double> max_error_mm;
  std::string parameters;  // JSON for its jobs, as parse_order_parameters reads it
  std::vector<SendTarget> send;
};

// Settings for receiving series by C-STORE.
struct DimseSettings {
  std::string listen;                         // HOST:PORT
  std::size_t associations = 8;               // simultaneous; further ones wait
  std::map<std::string, std::string> routes;  // AE title that series are sent to -> rule
  std::vector<std::string> calling;           // AE titles that may send
  std::filesystem::path certificate_file;     // empty: no TLS
  std::filesystem::path key_file;
  std::filesystem::path ca_file;  // peers need a certificate of these authorities; empty: none
  // The name that the certificate of a calling title must have; titles without one may have any.
  std::map<std::string, std::string> certificate_names;
  std::chrono::seconds idle{60};  // without any byte
  std::uint64_t max_object_bytes = std::uint64_t{4} << 30;
  std::uint64_t max_held_bytes = std::uint64_t{100} << 30;  // received but not used by an order yet
};

// Destination of the audit trail, syslog over TLS (RFC 5425).
struct SyslogSettings {
  std::string host;
  std::uint16_t port = 6514;
  std::filesystem::path ca_file;           // empty: the system's authorities
  std::filesystem::path certificate_file;  // client certificate; empty: none
  std::filesystem::path key_file;
};

// The own worklist, for workitems that others perform, or this daemon.
struct WorklistSettings {
  std::vector<std::string> requesters;  // may create and cancel workitems; empty: everybody
  std::vector<std::string> performers;  // may claim and perform them; empty: everybody
  std::size_t most = 10'000;            // workitems
};

struct HospitalSettings {
  std::chrono::seconds settle{60};  // a series' list of instances must be unchanged for this long
  std::chrono::seconds poll{30};
  std::chrono::seconds first_delay{5};  // after a failed attempt; doubles each time
  std::chrono::seconds longest_delay{std::chrono::hours(1)};
  std::chrono::seconds give_up{std::chrono::hours(72)};
  std::size_t most_open = 10'000;  // orders
  std::string station_name = "isomesh";
  std::vector<PacsSettings> pacs;
  std::vector<Rule> rules;
  std::optional<DimseSettings> dimse;
  std::optional<SyslogSettings> syslog;
  std::optional<WorklistSettings> worklist;

  // Null if there is no PACS with that name.
  const PacsSettings* find_pacs(std::string_view name) const;
  const Rule* find_rule(std::string_view name) const;
};

// Reads TOML. Throws Error kInvalidParameter that names the key that is unknown, missing, of the
// wrong type or out of range (without its value), or the line with a syntax error.
HospitalSettings read_settings(const std::filesystem::path& file);
HospitalSettings parse_settings(std::string_view toml);

}  // namespace isomesh::orders
