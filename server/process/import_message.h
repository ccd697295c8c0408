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
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/volume/size.h"

namespace isomesh::process {

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

std::string to_message(const ImportOrder& order);
// Throws Error kInternal when the message is no order.
ImportOrder order_from(std::string_view message);

// Each makes one line, with its line break.
std::string begun_message();
std::string reading_message(std::string_view format);
std::string volume_message(const Volume& volume);
std::string error_message(const Error& error);

// What an importing process has said so far.
struct ImportReport {
  bool begun = false;   // it has its order and is about to open the file
  std::string reading;  // the last format that it named; printable
  std::optional<Volume> volume;
  std::optional<Error> error;
};

// Reads whole lines; a last line without its break is passed over. Throws Error kInternal when a
// line is not of the form that isomesh-import writes.
ImportReport report_from(std::string_view messages);

}  // namespace isomesh::process
