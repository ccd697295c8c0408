#include "server/import/peers/series.h"

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/text.h"
#include "proto/error.h"
#include "server/import/dicom/choosing/series.h"
#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/import.h"
#include "server/import/dicom/pixels/decode.h"
#include "server/import/peers/multipart.h"
#include "server/import/source/reader.h"
#include "server/import/source/scratch_folder.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMostInstances = 20000;

// Compares the patients of a series' instances. Error messages never name a patient.
class PatientCheck {
 public:
  // Throws Error kUnusableVolume.
  void add(const dicom::DataSet& data) {
    const std::string id(trimmed(dicom::utf8(data, dicom::kPatientId)));
    const std::string issuer(trimmed(dicom::utf8(data, dicom::kIssuerOfPatientId)));
    if (!id_) id_ = id;
    if (issuer_.empty()) issuer_ = issuer;
    if (id == *id_ && (issuer.empty() || issuer == issuer_)) return;
    throw Error(ErrorCode::kUnusableVolume,
                "the images of the series have different patients (Patient ID)");
  }

 private:
  std::optional<std::string> id_;
  std::string issuer_;  // may be missing in some images
};

// A user knows the images of a PACS by these, and not by their place in the response, which looks
// like the number of a slice.
NamedFile named_by_instance(const std::filesystem::path& part, const dicom::DataSet& data) {
  const std::string uid = "SOP Instance UID " + dicom::utf8(data, dicom::kSopInstanceUid);
  const auto number = data.integer(dicom::kInstanceNumber);
  if (!number) return {part, uid, uid};
  const std::string text = std::to_string(*number);
  return {part, "instance number " + text, "Instance number " + text + " (" + uid + ')'};
}

// Throws with the part's number if the part cannot be read.
dicom::DicomFile opened(const std::filesystem::path& part, std::size_t number,
                        const ImportTask& task) {
  try {
    return {part, task.scratch, task.limits.max_sample_bytes};
  } catch (const Error& error) {
    dicom::rethrow_for({part, "", "Part " + std::to_string(number) + " of the response"}, error);
  }
}

// A PACS sends images as it stores them if it may, and usually converts them otherwise.
void check_readable(const dicom::DicomFile& file) {
  const std::string& syntax = file.transfer_syntax();
  if (!file.pixels() || !file.pixels()->is_encapsulated || dicom::can_decode(syntax)) return;
  throw Error(ErrorCode::kUnusableVolume,
              "the PACS sends the images in the transfer syntax " + in_quotes(syntax) +
                  ", which is not supported: set transfer-syntax of this PACS to another one that "
                  "it supports, such as \"1.2.840.10008.1.2.1\"");
}

// The files of the series' instances, without duplicates. Rejects missing instances, because half a
// head is also a valid volume, and instances of several patients.
std::vector<NamedFile> checked(const std::vector<std::filesystem::path>& parts,
                               const PeersSeries& asked, const ImportTask& task) {
  std::vector<NamedFile> files;
  std::set<std::string> instances;
  PatientCheck patients;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    const dicom::DicomFile file = opened(parts[n], n + 1, task);
    const dicom::DataSet& data = file.data();
    if (data.text(dicom::kStudyInstanceUid) != asked.study ||
        data.text(dicom::kSeriesInstanceUid) != asked.series) {
      throw Error(ErrorCode::kSeriesIncomplete,
                  "the PACS sent an object of another series than the requested one");
    }
    patients.add(data);
    check_readable(file);
    if (instances.emplace(data.text(dicom::kSopInstanceUid)).second) {
      files.push_back(named_by_instance(parts[n], data));
    }
  }
  const std::set<std::string> listed(asked.instances.begin(), asked.instances.end());
  if (instances == listed) return files;
  throw Error(ErrorCode::kSeriesIncomplete, "the PACS sent " + std::to_string(instances.size()) +
                                                " objects of the series, but lists " +
                                                std::to_string(listed.size()));
}

}  // namespace

Volume read_peers_series(const ImportTask& task, const FormatListener& listener) {
  const PeersSeries& asked = *task.options.peers;
  const TemporaryFolder folder(task.scratch, "parts-");
  const MultipartLimits limits = {.max_bytes = task.limits.max_sample_bytes + kHeadroomBytes,
                                  .max_parts = kMostInstances};
  const auto parts =
      is_single_dicom(asked.content_type)
          ? std::vector{task.source}
          : unpack_multipart(task.source, boundary_of(asked.content_type), folder.path(), limits);
  if (listener) listener("dicom");
  const std::vector<NamedFile> files = checked(parts, asked, task);
  try {
    return import_dicom(files, task);
  } catch (const Error& error) {
    // Orders have none of the parameters that a remedy names.
    throw Error(error.code(), error.what());
  }
}

}  // namespace isomesh::import
