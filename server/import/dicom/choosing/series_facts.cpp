#include "server/import/dicom/choosing/series_facts.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/pixels/pixels.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/source/choice_picture.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::size_t kMostPictures = 100;
constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 24;  // of an image to be reduced

// Skips pixels instead of averaging them, which is enough for a picture of this size.
std::vector<double> reduced(std::span<const double> values, const PixelLayout& layout,
                            std::uint32_t step) {
  std::vector<double> some;
  for (std::uint32_t row = 0; row < layout.rows; row += step) {
    for (std::uint32_t column = 0; column < layout.columns; column += step) {
      some.push_back(values[std::size_t{row} * layout.columns + column]);
    }
  }
  return some;
}

// The middle frame of an object. Empty if it cannot be shown, which is no fault of the upload: a
// series that is chosen says what is wrong with it.
std::optional<ChoicePicture> picture_of(const DicomFile& file, const Image& image) {
  const PixelLayout& layout = image.layout;
  if (image.frames.empty() || image.segmentation || layout.samples() == 0) return std::nullopt;
  if (layout.samples() > kMostPixels || layout.bits_allocated < 8) return std::nullopt;
  const Frame& frame = image.frames[image.frames.size() / 2];
  std::vector<std::byte> stored(layout.frame_bytes());
  FrameReader(file, image).read(frame.number, stored);
  std::vector<double> values(layout.samples());
  if (!convert_frame(stored, layout, frame.rescale, SampleType::kFloat64,
                     std::as_writable_bytes(std::span(values)))) {
    return std::nullopt;
  }
  const std::uint32_t longer = std::max(layout.columns, layout.rows);
  const std::uint32_t step = (longer + kMostPictureSide - 1) / kMostPictureSide;
  const std::vector<double> some = reduced(values, layout, step);
  return import::picture_of(some, (layout.columns + step - 1) / step, window_of(some));
}

SeriesFacts facts_of(const DataSet& data) {
  return {.patient_name = utf8(data, kPatientName),
          .patient_id = utf8(data, kPatientId),
          .study_uid = utf8(data, kStudyInstanceUid),
          .study_description = utf8(data, kStudyDescription),
          .study_date = utf8(data, kStudyDate)};
}

}  // namespace

Error with_series_facts(const Error& error, std::span<const Source> sources,
                        const std::filesystem::path& scratch, std::uint64_t most_sample_bytes) {
  Remedy remedy = error.remedy();
  std::size_t pictures = 0;
  for (Choice& choice : remedy.choices) {
    if (choice.parameter != "series") continue;
    std::vector<const Source*> own;
    for (const Source& source : sources) {
      if (source.series_uid == choice.value && !source.fault) own.push_back(&source);
    }
    if (own.empty()) continue;
    // Files are named in the order of the slices by most scanners, so this one shows the middle.
    const Source& middle = *own[own.size() / 2];
    try {
      const DicomFile file(middle.file.path, scratch, most_sample_bytes);
      choice.series = facts_of(file.data());
      if (pictures++ < kMostPictures) choice.picture = picture_of(file, middle.image);
    } catch (const Error& unreadable) {
      if (unreadable.code() != ErrorCode::kUnusableVolume) throw;
    }
  }
  return error.with_remedy(std::move(remedy));
}

}  // namespace isomesh::import::dicom
