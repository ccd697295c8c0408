#include "server/import/dicom/choosing/series.h"

#include <algorithm>
#include <map>

#include "base/files.h"
#include "base/text.h"
#include "server/import/dicom/contours/structure_set.h"
#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/kinds/describe.h"
#include "server/import/source/gzip.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// Some anonymisers keep identifiers only in the meta information, which is the fallback.
DicomInstance instance_of(const DicomFile& file) {
  DicomInstance instance = {utf8(file.data(), kSopClassUid), utf8(file.data(), kSopInstanceUid)};
  if (instance.sop_class_uid.empty()) instance.sop_class_uid = file.meta().sop_class_uid;
  if (instance.sop_instance_uid.empty()) instance.sop_instance_uid = file.meta().sop_instance_uid;
  return instance;
}

// Some programs write no UIDs. The name of such a series cannot be a valid UID: those do not end
// with a component 0 after a single number.
std::string series_name(const DataSet& data) {
  std::string uid = utf8(data, kSeriesInstanceUid);
  if (!uid.empty()) return uid;
  return std::to_string(data.integer(kSeriesNumber).value_or(0)) + ".0";
}

Source describe_source(const NamedFile& from, const DicomFile& file) {
  const DataSet& data = file.data();
  Source source;
  source.file = from;
  source.series_uid = series_name(data);
  source.series_description = utf8(data, kSeriesDescription);
  source.series_number = data.integer(kSeriesNumber);
  source.frame_count = std::max<std::int64_t>(data.integer(kNumberOfFrames).value_or(1), 1);
  source.instance = instance_of(file);
  try {
    source.image = describe_image(file);
  } catch (const Error& error) {
    source.fault = error;
  }
  return source;
}

bool begins_as_dicom(const std::filesystem::path& path) {
  const std::string head = InputFile(path).text(0, kSniffBytes);
  return find_beginning(is_gzip(head) ? inflate_head(head, kSniffBytes) : head).has_value();
}

class HeaderReader {
 public:
  HeaderReader(std::filesystem::path scratch, std::uint64_t most_sample_bytes)
      : scratch_(std::move(scratch)), most_sample_bytes_(most_sample_bytes) {}

  void read(const NamedFile& from) {
    if (!begins_as_dicom(from.path)) {
      return ignore(upload_, from, "it is not a DICOM file");
    }
    const DicomFile file(from.path, scratch_, most_sample_bytes_);
    if (is_structure_set(file.data())) return read_structure_set(from, file);
    if (const auto reason = reason_to_ignore(file)) return ignore(upload_, from, *reason);
    Source source = describe_source(from, file);
    const std::string& uid = source.instance.sop_instance_uid;
    const auto [known, is_new] = first_with_uid_.try_emplace(uid, from);
    if (!is_new && same_bytes(known->second.path, from.path)) {
      ++doubles_;
      return ignore(upload_, from, reason_of_double(known->second.name));
    }
    upload_.sources.push_back(std::move(source));
  }

  Upload finish() {
    if (doubles_ > 0) upload_.notes.push_back(duplicate_note(doubles_));
    return std::move(upload_);
  }

 private:
  void read_structure_set(const NamedFile& from, const DicomFile& file) {
    const DataSet& data = file.data();
    for (const StructureFile& known : upload_.structure_sets) {
      if (!same_bytes(known.file.path, from.path)) continue;
      ++doubles_;
      return ignore(upload_, from, reason_of_double(known.file.name));
    }
    upload_.structure_sets.push_back(
        {from, series_name(data), utf8(data, kSeriesDescription), frame_of_structures(data)});
  }

  std::filesystem::path scratch_;
  std::uint64_t most_sample_bytes_;
  Upload upload_;
  std::map<std::string, NamedFile> first_with_uid_;
  std::size_t doubles_ = 0;
};

// One entry per series: "head, 93 slices".
std::vector<Choice> list_series(std::span<const Source> sources) {
  struct Series {
    std::string description;
    std::string modality;
    std::optional<std::int64_t> number;
    std::int64_t slices = 0;
  };
  std::map<std::string, Series> all;
  for (const Source& source : sources) {
    Series& series = all[source.series_uid];
    series.description = source.series_description;
    series.modality = source.image.modality;
    series.number = source.series_number;
    series.slices += source.frame_count;
  }
  const auto title_of = [](const Series& series) {
    std::string title;
    for (const std::string& part : {series.description, series.modality}) {
      if (!part.empty()) title += part + ", ";
    }
    return title + count_of(static_cast<std::size_t>(series.slices), "slice");
  };
  std::map<std::string, std::size_t> uses;
  for (const auto& entry : all) ++uses[title_of(entry.second)];
  std::vector<Choice> choices;
  for (const auto& [uid, series] : all) {
    std::string title = title_of(series);
    // The number is the scanner's, and tells equal series apart.
    if (uses[title] > 1 && series.number) title += ", series " + std::to_string(*series.number);
    choices.push_back({"series", uid, title});
  }
  return choices;
}

std::string joined_titles(const std::vector<Choice>& choices) {
  constexpr std::size_t kMostNamed = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(choices.size(), kMostNamed); ++i) {
    text += (i == 0 ? "" : "; ") + choices[i].title + " (" + choices[i].value + ')';
  }
  return text + (choices.size() > kMostNamed ? "; ..." : "");
}

[[noreturn]] void throw_series_choice(const std::string& reason,
                                      const std::vector<Choice>& choices) {
  throw_choice(reason + ". Choose one with series=UID: " + joined_titles(choices) + '.', choices);
}

std::vector<Choice> list_all(const Upload& upload) {
  std::vector<Choice> choices = list_series(upload.sources);
  for (const StructureFile& each : upload.structure_sets) {
    choices.push_back({"series", each.series_uid,
                       (each.description.empty() ? "" : each.description + ", ") +
                           "RTSTRUCT, contours of structures"});
  }
  return choices;
}

DicomCode code_of(const DataSet& data, Tag sequence) {
  const DataSet* code = data.item(sequence);
  if (code == nullptr) return {};
  return {.value = utf8(*code, kCodeValue),
          .scheme = utf8(*code, kCodingSchemeDesignator),
          .meaning = utf8(*code, kCodeMeaning)};
}

std::vector<DicomSegment> segments_of(const DataSet& data) {
  std::vector<DicomSegment> segments;
  for (const DataSet& item : data.items(kSegmentSequence)) {
    const auto number = item.unsigned_number(kSegmentNumber);
    if (!number) continue;
    segments.push_back({.label = *number,
                        .category = code_of(item, kSegmentedPropertyCategoryCodeSequence),
                        .type = code_of(item, kSegmentedPropertyTypeCodeSequence),
                        .region = code_of(item, kAnatomicRegionSequence)});
  }
  std::ranges::sort(segments, {}, &DicomSegment::label);
  return segments;
}

}  // namespace

void ignore(Upload& upload, const NamedFile& file, const std::string& reason) {
  constexpr std::size_t kMostNamedObjects = 100;
  if (upload.ignored.size() < kMostNamedObjects) upload.ignored.push_back({file.name, reason});
}

void rethrow_for(const NamedFile& file, const Error& error) {
  throw Error(error.code(), file.title + ": " + error.what());
}

Upload read_headers(std::span<const NamedFile> files, const std::filesystem::path& scratch,
                    std::uint64_t most_sample_bytes) {
  HeaderReader reader(scratch, most_sample_bytes);
  for (const NamedFile& file : files) {
    try {
      reader.read(file);
    } catch (const Error& error) {
      if (files.size() == 1) throw;
      rethrow_for(file, error);
    }
  }
  Upload upload = reader.finish();
  if (files.size() > 1) {
    for (Source& source : upload.sources) source.image.file_name = source.file.name;
  }
  if (!upload.sources.empty() || !upload.structure_sets.empty()) return upload;
  if (upload.ignored.size() == 1) {
    throw_unusable("The upload has no DICOM image: " + upload.ignored.front().reason + ".");
  }
  throw_unusable("None of the upload's " + std::to_string(files.size()) +
                 " files is a DICOM image that can be part of a volume.");
}

const StructureFile* chosen_structures(const Upload& upload, const std::string& uid) {
  const auto& all = upload.structure_sets;
  if (all.empty()) return nullptr;
  const bool has_images = !upload.sources.empty();
  const auto is_chosen = [&](const StructureFile& each) { return each.series_uid == uid; };
  const auto count = uid.empty() ? std::ssize(all) : std::ranges::count_if(all, is_chosen);
  if (uid.empty() ? count == 1 && !has_images : count == 1) {
    return uid.empty() ? &all.front() : &*std::ranges::find_if(all, is_chosen);
  }
  if (!uid.empty() && count == 0 && has_images) return nullptr;
  if (count > 1 && !uid.empty()) {
    throw_unusable("The upload has " + std::to_string(count) +
                   " structure sets of the series. Send each one by itself with its images.");
  }
  const std::vector<Choice> choices = list_all(upload);
  throw_series_choice("The upload holds " + std::to_string(choices.size()) + " series", choices);
}

std::vector<Source> images_of(const StructureFile& structures, std::vector<Source> sources) {
  const std::string& frame = structures.frame_of_reference_uid;
  std::erase_if(sources, [&](const Source& source) {
    return frame.empty() || source.fault || source.image.segmentation ||
           source.image.frame_of_reference_uid != frame || source.image.modality == "RTDOSE";
  });
  std::map<std::string, std::int64_t> slices;
  for (const Source& source : sources) slices[source.series_uid] += source.frame_count;
  if (slices.empty()) return {};
  const std::string uid =
      std::ranges::max_element(slices, {}, [](const auto& entry) { return entry.second; })->first;
  std::erase_if(sources, [&](const Source& source) { return source.series_uid != uid; });
  return sources;
}

std::vector<Source> choose_series(std::vector<Source> sources, const std::string& uid) {
  const std::vector<Choice> all = list_series(sources);
  if (!uid.empty()) {
    std::erase_if(sources, [&](const Source& source) { return source.series_uid != uid; });
    if (sources.empty()) throw_series_choice("The upload has no series " + in_quotes(uid), all);
  } else if (all.size() > 1) {
    throw_series_choice("The upload holds " + std::to_string(all.size()) + " series", all);
  }
  for (const Source& source : sources) {
    if (!source.fault) continue;
    if (sources.size() == 1) throw *source.fault;
    rethrow_for(source.file, *source.fault);
  }
  return sources;
}

DicomIdentity identity_of(const DataSet& data) {
  return {.patient_name = utf8(data, kPatientName),
          .patient_id = utf8(data, kPatientId),
          .patient_birth_date = utf8(data, kPatientBirthDate),
          .patient_sex = utf8(data, kPatientSex),
          .study_uid = utf8(data, kStudyInstanceUid),
          .study_date = utf8(data, kStudyDate),
          .study_time = utf8(data, kStudyTime),
          .study_id = utf8(data, kStudyId),
          .study_description = utf8(data, kStudyDescription),
          .accession_number = utf8(data, kAccessionNumber),
          .referring_physician = utf8(data, kReferringPhysician),
          .series_uid = utf8(data, kSeriesInstanceUid),
          .series_description = utf8(data, kSeriesDescription),
          .modality = utf8(data, kModality),
          .frame_of_reference_uid = utf8(data, kFrameOfReferenceUid),
          .instances = {},
          .issuer_of_patient_id = utf8(data, kIssuerOfPatientId),
          .patient_identity_removed = utf8(data, kPatientIdentityRemoved),
          .deidentification_method = utf8(data, kDeidentificationMethod),
          .acquisition_datetime = utf8(data, kAcquisitionDateTime),
          .position_reference_indicator = utf8(data, kPositionReferenceIndicator),
          .equipment = {.manufacturer = utf8(data, kManufacturer),
                        .model_name = utf8(data, kManufacturerModelName),
                        .station_name = utf8(data, kStationName),
                        .device_serial_number = utf8(data, kDeviceSerialNumber),
                        .software_versions = utf8(data, kSoftwareVersions)},
          .segments = segments_of(data)};
}

}  // namespace isomesh::import::dicom
