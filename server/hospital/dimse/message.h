// The messages between the daemon and isomesh-dimse, over a socket. The daemon passes the
// connection to a peer and one line with the order. A sending process answers with one line. A
// receiving one reports each object in a line, gets a verdict on each, and reports the
// association's end.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace isomesh::dimse {

// An object to send over an association of its own.
struct DimseSending {
  std::string calling;  // application entity titles
  std::string called;
  std::filesystem::path file;
  std::string sop_class;
  std::string instance;                       // SOP Instance UID
  std::chrono::seconds timeout{30};           // limit without a byte
  std::chrono::seconds response_timeout{30};  // limit for the peer's C-STORE response

  bool operator==(const DimseSending&) const = default;
};

// An incoming association.
struct DimseReceiving {
  std::vector<std::string> called;   // accepted called titles
  std::vector<std::string> calling;  // accepted calling titles
  std::filesystem::path folder;      // for objects, until the daemon takes them
  std::uint64_t max_object_bytes = 0;
  std::chrono::seconds idle{60};

  bool operator==(const DimseReceiving&) const = default;
};

using DimseOrder = std::variant<DimseSending, DimseReceiving>;

// The result of sending an object.
enum class DimseEnd {
  kResponded,    // the peer responded to the C-STORE
  kRejected,     // the association, for example because of an unknown title
  kBusy,         // the association, temporarily
  kNotAccepted,  // presentation context of the object's class
  kUnanswered,   // the peer ended the connection, or sent no DICOM, in place of an association
  kBroken,       // the connection ended later
  kTimeout,
  kUnreadable,  // malformed response
};

struct DimseSent {
  DimseEnd end = DimseEnd::kBroken;
  std::uint16_t status = 0;  // of the C-STORE response, for kResponded

  bool operator==(const DimseSent&) const = default;
};

// A received object in the folder.
struct DimseObject {
  std::string file;
  std::string called;
  std::string calling;
  std::string study;
  std::string series;
  std::string instance;

  bool operator==(const DimseObject&) const = default;
};

// The result of an incoming association.
enum class DimseRefusal {
  kNone,     // accepted, whatever its end
  kCalled,   // rejected: wrong called title
  kCalling,  // rejected: wrong calling title
  kOther,    // no association was established
};

struct DimseEnded {
  DimseRefusal refusal = DimseRefusal::kOther;
  // The titles of a rejected association; empty if they are not valid.
  std::string called = {};
  std::string calling = {};

  bool operator==(const DimseEnded&) const = default;
};

using DimseReport = std::variant<DimseSent, DimseObject, DimseEnded>;

// The daemon's verdict on an object, one byte.
enum class DimseVerdict : char { kStored = 's', kNoRoom = 'n' };

// Return one line, with its line break.
std::string to_line(const DimseOrder& order);
std::string to_line(const DimseReport& report);

// Throw Error kInternal if the line is malformed. A report's UIDs and titles are valid, and its
// file is a name without a folder.
DimseOrder dimse_order_from(std::string_view line);
DimseReport dimse_report_from(std::string_view line);

// True if a text is a valid application entity title (PS3.5, 6.2, AE): 1 to 16 printable ASCII
// characters without a backslash, and no blanks at its ends.
bool is_ae_title(std::string_view text);

}  // namespace isomesh::dimse
