#include "server/import/images/stack.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/formats/placing.h"
#include "server/import/images/natural_order.h"
#include "server/import/images/page.h"
#include "server/import/images/palettes.h"
#include "server/import/images/tiff.h"
#include "server/import/samples/transfer.h"

namespace isomesh::import {
namespace {

// The pages of a volume, which must all be of one layout, one behind the other in a file.
class Pages {
 public:
  Pages(std::uint64_t count, const ImportTask& task)
      : task_(task), count_(count), samples_(task.scratch, ".pages") {}

  PageCheck check() {
    return [this](const PageLayout& layout) { take(layout); };
  }
  PageSink sink() {
    return [this](std::span<const std::byte> samples) {
      samples_.write(samples);
      palettes_.use(samples);
    };
  }

  // `source` has everything but dims, type and labels.
  Volume write(SourceVolume source) const {
    source.dims = described_.dims;
    source.layout.type = described_.layout.type;
    source.chosen = {};
    // A calibration makes other values of the indices.
    if (!source.layout.rescale) source.labels = palettes_.labels();
    source.labels_if_flat = true;
    if (auto note = palettes_.note()) source.notes.push_back(*std::move(note));
    if (!palettes_.replaces()) return write_canonical(InputFile(samples_.path()), source, task_);
    ScratchFile greys(task_.scratch, ".greys");
    write_greys(greys);
    return write_canonical(InputFile(greys.path()), source, task_);
  }

 private:
  void take(const PageLayout& layout) {
    if (layout_ && !layout_->is_like(layout)) {
      throw_unusable("The pages differ: one has " + text_of(*layout_) + ", another has " +
                     text_of(layout) + ".");
    }
    palettes_.begin(layout);
    if (layout_) return;
    layout_ = layout;
    const std::array<std::uint64_t, 3> sizes = {layout.width, layout.height, count_};
    described_.dims = volume_dims(sizes);
    refuse_flat("The file", described_.dims);
    described_.layout.type = layout.type;
    check_limits(described_, task_.limits);
  }

  // The pages with the greys of their palettes.
  void write_greys(ScratchFile& greys) const {
    const InputFile indices(samples_.path());
    std::vector<std::byte> row(layout_->bytes() / layout_->height);
    for (std::uint64_t at = 0; at < count_ * layout_->height; ++at) {
      indices.read_exactly(at * row.size(), row);
      palettes_.replace(at / layout_->height, row);
      greys.write(row);
    }
  }

  static std::string text_of(const PageLayout& layout) {
    return std::to_string(layout.width) + " x " + std::to_string(layout.height) + " samples of " +
           std::to_string(bytes_per_sample(layout.type)) + " bytes";
  }

  const ImportTask& task_;
  std::uint64_t count_;
  std::optional<PageLayout> layout_;
  SourceVolume described_;
  Palettes palettes_;
  ScratchFile samples_;
};

// Between volumes that are given by their numbers in the meaning.
Difference difference_of(const TiffMeaning& meaning, const std::vector<std::uint64_t>& volumes) {
  const bool by_channel = meaning.channels > 1;
  const bool by_time = meaning.times > 1;
  return {.what = by_channel && by_time ? "channel and time"
                  : by_channel          ? "channel"
                                        : "time",
          .title = [=, channels = meaning.channels](std::uint64_t index) {
            const std::string channel = "channel " + std::to_string(volumes[index] % channels);
            const std::string time = "time " + std::to_string(volumes[index] / channels);
            if (!by_time) return channel;
            return by_channel ? channel + ", " + time : time;
          }};
}

// Spacing and calibration.
void set_meaning(SourceVolume& source, const TiffMeaning& meaning) {
  source.has_spacing = meaning.spacing.has_value();
  if (meaning.spacing) source.geometry.spacing = *meaning.spacing;
  source.layout.rescale = meaning.rescale;
  if (!meaning.rescale) return;
  source.notes.push_back(
      note_of(NoteCode::kValuesRescaled,
              "The samples were changed by the calibration of ImageJ in the TIFF's description. "
              "Programs that ignore it show other values."));
}

Volume read_pages(TiffFile& tiff, const ImportTask& task) {
  const TiffMeaning meaning = tiff.meaning();
  check_pages(meaning, tiff.pages());
  Pages pages(meaning.slices, task);
  if (meaning.slices == 1)
    tiff.read(0, pages.check(), pages.sink());  // refused, whatever is chosen
  SourceVolume source;
  const std::vector<std::uint64_t> volumes = meaning.volumes();
  choose_volume(volumes.size(), difference_of(meaning, volumes), task.options, source);
  for (std::uint64_t slice = 0; slice < meaning.slices; ++slice) {
    const std::uint64_t page = meaning.page_of(volumes[source.chosen.index], slice);
    tiff.read(page, pages.check(), pages.sink());
  }
  set_meaning(source, meaning);
  source.notes.push_back(lps_assumed("A TIFF image"));
  return pages.write(std::move(source));
}

// An image file, inflated if it is compressed.
class PlainFile {
 public:
  PlainFile(const std::filesystem::path& path, const ImportTask& task) : path_(path) {
    const InputFile file(path);
    const std::string head = file.text(0, kSniffBytes);
    if (!is_gzip(head)) return;
    inflated_.emplace(task.scratch, ".inflated");
    path_ = inflated_->path();
    const std::uint64_t limit = most_image_bytes(file, task).file;
    const std::uint64_t bytes =
        inflate_range(file, {0, file.size()}, limit,
                      [&](std::span<const std::byte> piece) { inflated_->write(piece); });
    if (bytes > limit) throw_unusable("The compressed image is too large.");
  }

  InputFile open() const { return InputFile(path_); }

 private:
  std::filesystem::path path_;
  std::optional<ScratchFile> inflated_;
};

TiffMeaning read_page(const InputFile& file, Pages& pages) {
  const std::string head = file.text(0, kSniffBytes);
  if (is_png(head)) {
    read_png(file, pages.check(), pages.sink());
    return {};
  }
  if (is_bmp(head)) {
    read_bmp(file, pages.check(), pages.sink());
    return {};
  }
  TiffFile tiff(file);
  if (tiff.pages() > 1) throw_unusable("It has several pages. Send it by itself.");
  tiff.read(0, pages.check(), pages.sink());
  return tiff.meaning();
}

// All images of a volume have one calibration. Their spacing is known if all tell the same.
void unite(TiffMeaning& all, const TiffMeaning& next) {
  if (next.rescale != all.rescale) {
    throw_unusable("Its values are calibrated otherwise than those of the images before it.");
  }
  if (next.spacing != all.spacing) all.spacing.reset();
}

// In the order of the numbers in their names.
std::vector<ImageFile> in_order(const std::vector<ImageFile>& files) {
  std::vector<std::string> names;
  for (const ImageFile& file : files) names.push_back(file.name);
  std::vector<ImageFile> sorted;
  for (const std::size_t at : slice_order(names)) sorted.push_back(files[at]);
  return sorted;
}

// Files of one page may tell of all channels and times. Those of a part of the slices are one
// channel.
void check_files(const TiffMeaning& meaning, std::size_t files) {
  if (meaning.channels * meaning.times == 1 || files <= meaning.slices) return;
  throw_unusable("The descriptions of the TIFF files tell of " + counts_of(meaning) +
                 ", but there are " + std::to_string(files) +
                 " files. Put the images of each channel and time into a folder of their own.");
}

}  // namespace

bool has_pages(const std::filesystem::path& path) {
  const InputFile file(path);
  if (!is_tiff(file.text(0, kSniffBytes))) return false;
  try {
    return TiffFile(file).pages() > 1;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return false;  // reading it reports the damage
  }
}

Volume import_images(std::vector<ImageFile> files, const ImportTask& task) {
  if (files.size() == 1) {
    const PlainFile plain(files.front().path, task);
    const InputFile file = plain.open();
    if (is_tiff(file.text(0, kSniffBytes))) {
      TiffFile tiff(file);
      return read_pages(tiff, task);
    }
  }
  files = in_order(files);
  SourceVolume source;
  choose_volume(1, {}, task.options, source);
  Pages pages(files.size(), task);
  std::optional<TiffMeaning> all;
  for (const ImageFile& file : files) {
    try {
      const TiffMeaning meaning = read_page(PlainFile(file.path, task).open(), pages);
      if (!all) all = meaning;
      unite(*all, meaning);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnusableVolume || files.size() == 1) throw;
      throw error.with_detail(in_quotes(file.name) + ": " + error.what());
    }
  }
  check_files(all.value(), files.size());
  set_meaning(source, *all);
  source.notes.push_back(lps_assumed("A stack of images"));
  return pages.write(std::move(source));
}

Volume parse_image(const Input& input) { return import_images({{"", input.path}}, input.task); }

MostBytes most_image_bytes(const InputFile& /*beginning*/, const ImportTask& task) {
  return {.file = task.limits.max_sample_bytes + kHeadroomBytes};
}

}  // namespace isomesh::import
