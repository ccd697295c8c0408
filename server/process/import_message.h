// The messages between the daemon and isomesh-import, which talk over a socket. The daemon sends
// one order. The import answers with lines of JSON; the last holds the volume, or the error because
// of which there is none.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/volume/size.h"

namespace isomesh::process {

// What a file has to be that a PACS has sent: the answer to a request for one series.
struct PeersSeries {
  std::string content_type;  // of the answer, as it came
  std::string study;         // UIDs
  std::string series;
  std::vector<std::string> instances;  // all of them, ascending, each once
};

// What a request says about the uploaded file.
struct ImportOptions {
  std::optional<RawDescription> raw = {};  // empty: the file is of a format that says what it is
  std::string series = {};                 // UID of the DICOM series to take; empty: the only one
  // Which of the file's volumes to take, from 0 on; empty: the only one.
  std::optional<std::uint32_t> volume = {};
  // Which of an archive's volumes to take: the name of its member, or kDicomMember for what its
  // DICOM files make; empty: the only one.
  std::string member = {};
  std::vector<std::string> accept = {};      // names of notes for which nothing is refused
  std::optional<NiftiForm> nifti_form = {};  // empty: the sform, where there is one
  std::optional<PeersSeries> peers = {};     // empty: a client's upload

  bool accepts(NoteCode code) const {
    return std::ranges::find(accept, describe(code).name) != accept.end();
  }
};

// Stands for all DICOM files of an archive, whose members have other names.
inline constexpr std::string_view kDicomMember = "*.dcm";

struct ImportTask {
  std::filesystem::path source;   // what was uploaded
  std::filesystem::path scratch;  // a folder for temporary files
  std::filesystem::path target;   // the canonical file to be made, within `scratch`
  ImportOptions options = {};
  volume::SizeLimits limits = {};
};

// The memory and time that one import may take.
struct ImportBounds {
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  // beside the samples, which are mapped
  std::chrono::seconds time = std::chrono::minutes(10);
};

struct ImportOrder {
  ImportTask task;
  ImportBounds bounds;
};

// A file to be read that holds what a PACS has answered, in DICOM JSON (PS3.18, F).
struct AnswerTask {
  std::filesystem::path source;
};

struct AnswerOrder {
  AnswerTask task;
  ImportBounds bounds;
};

// One of the objects that a PACS told of; what it did not tell is empty. UIDs are UIDs (is_uid).
struct PeersObject {
  std::string study = {};
  std::string series = {};
  std::string instance = {};
  std::string patient_id = {};
  std::string modality = {};
  std::string series_description = {};
  std::optional<std::uint32_t> instances = {};  // of the series
  // Of an instance that was to be stored: the PACS has not, for that reason (PS3.18, I.2.2).
  std::optional<std::uint16_t> failure = {};

  bool operator==(const PeersObject&) const = default;
};

// What a PACS has answered.
struct PeersAnswer {
  std::vector<PeersObject> objects;  // that it found
  std::vector<PeersObject> stored;   // that it says it has stored
  std::vector<PeersObject> failed;   // that it has not

  bool operator==(const PeersAnswer&) const = default;
};

std::string to_message(const ImportOrder& order);
std::string to_message(const AnswerOrder& order);

// Which of the two it is; Throws Error kInternal when the message is none.
std::variant<ImportOrder, AnswerOrder> order_from(std::string_view message);

// Each makes one line, with its line break.
std::string begun_message();
std::string reading_message(std::string_view format);
std::string volume_message(const Volume& volume);
std::string answer_message(const PeersAnswer& answer);
std::string error_message(const Error& error);

// What an importing process has said so far.
struct ImportReport {
  bool begun = false;   // it has its order and is about to open the file
  std::string reading;  // the last format that it named; printable
  std::optional<Volume> volume;
  std::optional<PeersAnswer> answer;
  std::optional<Error> error;
};

// Reads whole lines; a last line without its break is passed over. Throws Error kInternal when a
// line is not of the form that isomesh-import writes.
ImportReport report_from(std::string_view messages);

}  // namespace isomesh::process
