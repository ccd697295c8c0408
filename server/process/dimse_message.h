// The messages between the daemon and isomesh-dimse, which talk over a socket. The daemon passes
// the connection to a peer and says in one line what is to be done with it. A process that sends an
// object answers with one line. One that receives tells of each object in a line, is told of each
// what became of it, and tells how the association ended.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace isomesh::process {

// An object that is to be sent over an association of its own.
struct DimseSending {
  std::string calling;  // application entity titles
  std::string called;
  std::filesystem::path file;
  std::string sop_class;
  std::string instance;                     // SOP Instance UID
  std::chrono::seconds timeout{30};         // without a byte
  std::chrono::seconds answer_timeout{30};  // until the peer says that it has stored the object
};

// An association that somebody else has begun.
struct DimseReceiving {
  std::vector<std::string> called;   // titles that the association may be for
  std::vector<std::string> calling;  // and those that it may come from
  std::filesystem::path folder;      // for objects, until the daemon has taken them
  std::uint64_t max_object_bytes = 0;
  std::chrono::seconds idle{60};
};

using DimseOrder = std::variant<DimseSending, DimseReceiving>;

// How the sending of an object ended.
enum class DimseEnd {
  kAnswered,     // the peer has said what became of the object
  kRejected,     // the association, such as for a title that it does not know
  kBusy,         // the association, for now
  kNotAccepted,  // objects of that class
  kBroken,       // the connection ended
  kTimeout,
  kUnreadable,  // an answer that is none
};

struct DimseSent {
  DimseEnd end = DimseEnd::kBroken;
  std::uint16_t status = 0;  // of the C-STORE response, where it was answered

  bool operator==(const DimseSent&) const = default;
};

// An object that lies in the folder.
struct DimseObject {
  std::string file;  // its name in the folder
  std::string called;
  std::string calling;
  std::string study;
  std::string series;
  std::string instance;

  bool operator==(const DimseObject&) const = default;
};

// How an association that was received ended.
enum class DimseRefusal {
  kNone,     // it was accepted, however it ended then
  kCalled,   // rejected: not one of the titles that it may be for
  kCalling,  // nor come from
  kOther,    // no association came about
};

struct DimseEnded {
  DimseRefusal refusal = DimseRefusal::kOther;

  bool operator==(const DimseEnded&) const = default;
};

using DimseReport = std::variant<DimseSent, DimseObject, DimseEnded>;

// What the daemon says of an object, in one byte.
enum class DimseVerdict : char { kStored = 's', kNoRoom = 'n' };

// Each is one line, with its line break.
std::string to_line(const DimseOrder& order);
std::string to_line(const DimseReport& report);

// Throw Error kInternal when the line is none of those. UIDs of a report are UIDs, its titles have
// what titles may have, and its file is a name without a folder.
DimseOrder dimse_order_from(std::string_view line);
DimseReport dimse_report_from(std::string_view line);

// Whether a text can be an application entity's title (PS3.5, 6.2, AE): 1 to 16 printable ASCII
// characters without a backslash, and no blanks at its ends.
bool is_ae_title(std::string_view text);

}  // namespace isomesh::process
