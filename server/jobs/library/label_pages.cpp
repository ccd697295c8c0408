#include "server/jobs/library/label_pages.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <string>

#include "proto/error.h"
#include "proto/json.h"
#include "server/codec/label_titles.h"
#include "server/jobs/limits.h"

namespace isomesh::jobs {
namespace {

constexpr std::size_t kPerPage = MeshSummary::kMostListedLabels;
constexpr std::size_t kNumberBytes = 8;
constexpr std::size_t kEntryBytes = 2 * kNumberBytes;

[[noreturn]] void throw_damaged() {
  throw Error(ErrorCode::kInternal, "the stored list of a job's labels or walls is damaged");
}

void append(std::uint64_t number, std::vector<std::byte>& bytes) {
  for (std::size_t n = 0; n < kNumberBytes; ++n) {
    bytes.push_back(static_cast<std::byte>(number >> (8 * n)));
  }
}

std::uint64_t number_at(std::span<const std::byte> bytes) {
  std::uint64_t number = 0;
  for (std::size_t n = 0; n < kNumberBytes; ++n) {
    number |= std::to_integer<std::uint64_t>(bytes[n]) << (8 * n);
  }
  return number;
}

void read(const store::BlobReader& file, std::uint64_t offset, std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const std::size_t count = file.read_at(offset, bytes);
    if (count == 0) throw_damaged();
    offset += count;
    bytes = bytes.subspan(count);
  }
}

std::vector<LabelSummary> labels_in(const std::string& text) {
  try {
    return labels_from_json(text);
  } catch (const Error&) {
    throw_damaged();
  }
}

void set_addresses(const std::string& job, std::vector<LabelSummary>& labels) {
  for (LabelSummary& label : labels) {
    for (auto& [format, file] : label.files) file.href = mesh_path(job, format, label.label);
  }
}

// The file of a job's walls, whose labels are told by their places.
class WallFile {
 public:
  struct Page {
    std::vector<mesh::WallArea> walls;
    std::optional<std::uint64_t> next;
  };

  WallFile(const Job& job, const store::BlobStore& blobs)
      : has_faces_(job.mesh->edge_contacts_count.has_value()),
        walls_(*job.mesh->walls_count),
        count_(walls_ + job.mesh->edge_contacts_count.value_or(0)) {
    if (count_ == 0) return;
    if (!job.mesh->wall_list) throw_damaged();
    file_ = blobs.open(job.mesh->wall_list->sha256);
    if (file_->size() / wall_bytes() != count_ || file_->size() % wall_bytes() != 0)
      throw_damaged();
    walls_first_ = are_walls_first();
  }

  // False in jobs of older servers, which list all walls.
  bool has_faces() const { return has_faces_; }

  Page page(std::uint64_t begin, bool edge_contacts, std::uint64_t labels) const {
    Page page;
    const std::uint64_t end = walls_first_ && !edge_contacts ? walls_ : count_;
    const bool is_all_shown = walls_first_ || edge_contacts || !has_faces_;
    for (std::uint64_t at = begin; at < end; at += kPerPage) {
      if (is_all_shown && page.walls.size() == kPerPage) {
        page.next = at;
        return page;
      }
      const auto here = read_walls(at, std::min<std::uint64_t>(kPerPage, end - at));
      for (std::size_t n = 0; n < here.size(); ++n) {
        check(here[n], labels);
        if (has_faces_ && here[n].faces == 0 && !edge_contacts) continue;
        if (page.walls.size() == kPerPage) {
          page.next = at + n;
          return page;
        }
        page.walls.push_back(here[n]);
      }
    }
    return page;
  }

 private:
  std::size_t wall_bytes() const { return (has_faces_ ? 4 : 3) * kNumberBytes; }

  // False if walls and edge contacts ascend together, as in files of older servers. A file in which
  // all contacts follow all walls in that order as well is taken for such a one, and read as a
  // whole.
  bool are_walls_first() const {
    if (!has_faces_ || walls_ == 0 || walls_ == count_) return true;
    const auto place = [](const mesh::WallArea& wall) { return std::pair(wall.a, wall.b); };
    const auto both = read_walls(walls_ - 1, 2);
    return place(both[0]) > place(both[1]);
  }

  static void check(const mesh::WallArea& wall, std::uint64_t labels) {
    const bool is_possible = wall.a > 0 && std::max(wall.a, wall.b) <= labels && wall.a != wall.b &&
                             std::isfinite(wall.area_mm2);
    if (!is_possible) throw_damaged();
  }

  std::vector<mesh::WallArea> read_walls(std::uint64_t begin, std::uint64_t count) const {
    std::vector<std::byte> bytes(count * wall_bytes());
    read(*file_, begin * wall_bytes(), bytes);
    std::vector<mesh::WallArea> walls;
    for (std::size_t at = 0; at < bytes.size(); at += wall_bytes()) {
      const auto number = [&](std::size_t n) {
        return number_at(std::span(bytes).subspan(at + n * kNumberBytes, kNumberBytes));
      };
      walls.push_back(
          {number(0), number(1), std::bit_cast<double>(number(2)), has_faces_ ? number(3) : 0});
    }
    return walls;
  }

  const bool has_faces_;
  const std::uint64_t walls_;  // that are no edge contacts
  const std::uint64_t count_;
  bool walls_first_ = true;
  std::unique_ptr<store::BlobReader> file_;  // null if there are no walls
};

}  // namespace

void write_label_pages(std::span<const LabelSummary> labels, const codec::Sink& sink) {
  std::vector<std::byte> index;
  std::uint64_t offset = 0;
  for (std::size_t begin = 0; begin < labels.size(); begin += kPerPage) {
    const auto page = labels.subspan(begin, std::min(kPerPage, labels.size() - begin));
    const std::string text = to_json(std::vector(page.begin(), page.end()), "");
    append(static_cast<std::uint64_t>(page.front().label), index);
    append(offset, index);
    sink(std::as_bytes(std::span(text)));
    offset += text.size();
  }
  sink(index);
}

JobLabels::JobLabels(const Job& job, const store::BlobStore& blobs)
    : job_(job), count_(job.mesh->labels.size()) {
  if (!job.mesh->label_list) return;
  count_ = job.mesh->labels_count.value_or(0);
  file_ = blobs.open(job.mesh->label_list->sha256);
  read_index(*job.mesh->label_list);
}

void JobLabels::read_index(const LabelListFile& file) {
  const bool is_possible = count_ > 0 && count_ <= Volume::kMostLabels;
  const std::uint64_t pages = is_possible ? (count_ + kPerPage - 1) / kPerPage : 0;
  if (pages == 0 || file_->size() != file.bytes || file.bytes <= pages * kEntryBytes) {
    throw_damaged();
  }
  end_of_pages_ = file.bytes - pages * kEntryBytes;
  std::vector<std::byte> index(pages * kEntryBytes);
  read(*file_, end_of_pages_, index);
  for (std::size_t at = 0; at < index.size(); at += kEntryBytes) {
    const auto entry = std::span(index).subspan(at, kEntryBytes);
    const Page page = {static_cast<std::int64_t>(number_at(entry)),
                       number_at(entry.subspan(kNumberBytes))};
    const bool follows =
        pages_.empty() ? page.offset == 0
                       : page.first > pages_.back().first && page.offset > pages_.back().offset;
    if (!follows || page.offset >= end_of_pages_) throw_damaged();
    pages_.push_back(page);
  }
}

std::vector<LabelSummary> JobLabels::page(std::size_t n) const {
  const std::uint64_t begin = pages_[n].offset;
  const std::uint64_t end = n + 1 < pages_.size() ? pages_[n + 1].offset : end_of_pages_;
  if (end - begin > limits::kMostLabelPageBytes) throw_damaged();
  std::string text(end - begin, '\0');
  read(*file_, begin, std::as_writable_bytes(std::span(text)));
  std::vector<LabelSummary> labels = labels_in(text);
  const std::size_t expected = std::min<std::uint64_t>(kPerPage, count_ - n * kPerPage);
  const auto is_out_of_order = [](const LabelSummary& one, const LabelSummary& next) {
    return one.label >= next.label;
  };
  if (labels.size() != expected || labels.front().label != pages_[n].first ||
      std::ranges::adjacent_find(labels, is_out_of_order) != labels.end()) {
    throw_damaged();
  }
  return labels;
}

std::size_t JobLabels::page_of(std::int64_t label) const {
  const auto next = std::ranges::upper_bound(pages_, label, {}, &Page::first);
  return next == pages_.begin() ? 0 : static_cast<std::size_t>(next - pages_.begin()) - 1;
}

std::vector<LabelSummary> JobLabels::after(std::optional<std::int64_t> label) const {
  const auto is_behind = [&](const LabelSummary& each) { return !label || each.label > *label; };
  std::vector<LabelSummary> labels;
  if (!file_) {
    const auto& all = job_.mesh->labels;
    const auto begin = std::ranges::partition_point(all, std::not_fn(is_behind));
    const auto count = std::min<std::ptrdiff_t>(kPerPage, all.end() - begin);
    labels.assign(begin, begin + count);
  } else {
    for (std::size_t n = label ? page_of(*label) : 0; labels.empty() && n < pages_.size(); ++n) {
      labels = page(n);
      std::erase_if(labels, std::not_fn(is_behind));
    }
  }
  set_addresses(job_.id, labels);
  return labels;
}

bool JobLabels::has_after(std::int64_t last) const {
  return file_ ? page_of(last) + 1 < pages_.size() : job_.mesh->labels.back().label > last;
}

void JobLabels::for_each(const std::function<void(const LabelSummary& label)>& visit) const {
  if (!file_) std::ranges::for_each(job_.mesh->labels, visit);
  for (std::size_t n = 0; n < pages_.size(); ++n) std::ranges::for_each(page(n), visit);
}

std::optional<LabelSummary> JobLabels::find(std::int64_t label) const {
  const auto found_in = [&](const std::vector<LabelSummary>& labels) {
    const auto found = std::ranges::lower_bound(labels, label, {}, &LabelSummary::label);
    const bool is_there = found != labels.end() && found->label == label;
    return is_there ? std::optional(*found) : std::nullopt;
  };
  return file_ ? found_in(page(page_of(label))) : found_in(job_.mesh->labels);
}

std::map<std::uint64_t, LabelSummary> JobLabels::at(const std::set<std::uint64_t>& places) const {
  std::map<std::uint64_t, LabelSummary> labels;
  std::vector<LabelSummary> here;
  std::optional<std::size_t> read;
  for (const std::uint64_t place : places) {
    const std::size_t n = (place - 1) / kPerPage;
    if (file_ && read != n) here = page(*(read = n));
    labels.emplace(place, file_ ? here[(place - 1) % kPerPage] : job_.mesh->labels[place - 1]);
  }
  return labels;
}

void write_walls(std::span<const mesh::WallArea> walls, const codec::Sink& sink) {
  std::vector<std::byte> bytes;
  for (const bool edge_contacts : {false, true}) {
    for (const mesh::WallArea& wall : walls) {
      if ((wall.faces == 0) != edge_contacts) continue;
      append(wall.a, bytes);
      append(wall.b, bytes);
      append(std::bit_cast<std::uint64_t>(wall.area_mm2), bytes);
      append(wall.faces, bytes);
    }
  }
  sink(bytes);
}

WallPage walls_of(const Job& job, std::uint64_t begin, bool edge_contacts,
                  const store::BlobStore& blobs) {
  if (!job.parameters.labels) return {};
  if (!job.mesh->walls_count) {
    throw Error(ErrorCode::kNotFound,
                "the job was made before walls were measured; submit it again to have them");
  }
  const WallFile file(job, blobs);
  const JobLabels labels(job, blobs);
  const auto places = file.page(begin, edge_contacts, labels.count());
  std::set<std::uint64_t> named;
  for (const mesh::WallArea& wall : places.walls) {
    named.insert(wall.a);
    if (wall.b != 0) named.insert(wall.b);
  }
  const std::map<std::uint64_t, LabelSummary> found = labels.at(named);
  WallPage page = {.walls = {}, .next = places.next};
  for (const auto& [a, b, area, faces] : places.walls) {
    const LabelSummary& label = found.at(a);
    WallSummary& wall = page.walls.emplace_back();
    wall = {.a = label.label, .area_mm2 = area, .a_name = label.name};
    if (file.has_faces()) wall.faces = faces;
    if (b == 0) continue;
    wall.b = found.at(b).label;
    wall.b_name = found.at(b).name;
  }
  return page;
}

std::string materials_of(const JobLabels& labels) {
  std::string text;
  codec::ObjGroups groups;
  labels.for_each(
      [&](const LabelSummary& label) { text += codec::mtl_material(groups.of(label), label); });
  return text;
}

}  // namespace isomesh::jobs
