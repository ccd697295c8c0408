// JSON <-> types whose fields `visit` lists: one writer and one reader for requests, responses,
// records and the messages between processes. Errors are those of json_tree.h.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "base/held_folder.h"
#include "base/text.h"
#include "proto/fields.h"
#include "proto/json_tree.h"
#include "proto/record_digest.h"

namespace isomesh::json_values {

template <class T>
constexpr bool kIsPerFormat = false;
template <class T>
constexpr bool kIsPerFormat<std::map<MeshFormat, T>> = true;
template <class T>
constexpr bool kIsPerLabel = std::is_same_v<T, LabelTexts> || std::is_same_v<T, LabelValues>;

// An enumeration without names is written as a number. `last_of(value)` is its last value.
template <class T>
concept Numbered = Enumeration<T> && requires(T value) {
  last_of(value);
};
template <class T>
concept Path = requires(T value) {
  value.native();
};
template <class T>
concept Duration = requires(T value) {
  value.count();
};

// --- Writing -------------------------------------------------------------------------------------

template <class T>
void write(Json& place, const T& value);

template <class T>
void write_optional(Json& place, const std::optional<T>& value) {
  value ? write(place, *value) : assign_null(place);
}

template <class T>
void write_field(Json& object, const char* name, const T& value) {
  write(member(object, name), value);
}

template <class T>
void write_field(Json& object, const char* name, const std::optional<T>& value) {
  write_optional(member(object, name), value);
}

template <class T>
void write_field(Json& object, const Parameter& parameter, const std::optional<T>& value) {
  Json& place = member(object, parameter.name);
  const bool has_word = !value && parameter.when_empty != nullptr;
  has_word ? assign(place, std::string_view(parameter.when_empty)) : write_optional(place, value);
}

template <class T>
void write(Json& place, const T& value) {
  if constexpr (std::is_same_v<T, SchemeName>) {
    const std::string_view name = to_string(value);
    is_digits(name) ? assign(place, static_cast<std::int64_t>(value)) : assign(place, name);
  } else if constexpr (Numbered<T>) {
    assign(place, static_cast<std::int64_t>(value));
  } else if constexpr (Enumeration<T>) {
    assign(place, to_string(value));
  } else if constexpr (kIsPerFormat<T>) {
    make_object(place);
    for (const auto& [format, file] : value) write(member(place, to_string(format)), file);
  } else if constexpr (kIsPerLabel<T>) {
    make_object(place);
    for (const auto& [label, text] : value) write(member(place, std::to_string(label)), text);
  } else if constexpr (std::is_same_v<T, LabelChoice>) {
    value.is_all() ? assign(place, std::string_view(kAllLabels)) : write(place, value.values);
  } else if constexpr (std::is_same_v<T, bool>) {
    assign(place, value);
  } else if constexpr (std::is_floating_point_v<T>) {
    assign(place, static_cast<double>(value));
  } else if constexpr (std::is_unsigned_v<T>) {
    assign(place, std::uint64_t{value});
  } else if constexpr (std::is_integral_v<T>) {
    assign(place, std::int64_t{value});
  } else if constexpr (std::is_same_v<T, std::string>) {
    assign(place, std::string_view(value));
  } else if constexpr (Path<T>) {
    // Only messages have paths; their reader is another process.
    assign(place, std::string_view(for_other_process(value).native()));
  } else if constexpr (Duration<T>) {
    assign(place, std::int64_t{value.count()});
  } else if constexpr (requires { value.begin(); }) {
    make_array(place);
    for (const auto& element : value) write(append(place), element);
  } else {
    make_object(place);
    visit(value, [&](const auto& name, const auto& member) { write_field(place, name, member); });
    if constexpr (std::is_base_of_v<MeshParameters, T>) {
      if (!value.preset.empty()) write_field(place, rows::kIso, value.preset);
    }
  }
}

template <class T>
std::string to_text(const T& value) {
  JsonTree tree;
  write(tree.root(), value);
  return dump(tree.root());
}

// {"NAME": value}
template <class T>
std::string object(const char* name, const T& value) {
  JsonTree tree;
  write_field(tree.root(), name, value);
  return dump(tree.root());
}

// {"NAME": [...], "next": cursor}; `next` is null on the last page.
template <class T>
std::string page(const char* name, const std::vector<T>& items, const std::string& next) {
  JsonTree tree;
  write_field(tree.root(), name, items);
  write_field(tree.root(), "next", next.empty() ? std::nullopt : std::optional(next));
  return dump(tree.root());
}

// In full, for readers of this program.
template <class T>
void write_record(Json& place, const T& value) {
  write(place, value);
}

inline void write_record(Json& place, const Volume& volume) {
  write(place, volume);
  if (!volume.labels.empty()) write_field(place, "labels", volume.labels);
}

inline void write_record(Json& place, const Job& job) {
  write(place, job);
  if (job.mesh && job.mesh->label_list) {
    write_field(member(place, "mesh"), "label_list", job.mesh->label_list);
  }
  if (job.mesh && job.mesh->wall_list) {
    write_field(member(place, "mesh"), "wall_list", job.mesh->wall_list);
  }
}

template <class T>
std::string full_text(const T& value) {
  JsonTree tree;
  write_record(tree.root(), value);
  return dump(tree.root());
}

template <class T>
std::string record_of(const T& value) {
  return with_digest(full_text(value));
}

// --- Reading -------------------------------------------------------------------------------------

template <class T>
void read(const Json& json, T& value);

template <class T>
constexpr bool kIsOptional = false;
template <class T>
constexpr bool kIsOptional<std::optional<T>> = true;

inline bool may_be_absent(const char* /*name*/) { return false; }
inline bool may_be_absent(const Parameter& parameter) { return parameter.may_be_absent; }

// Labels are the names of members.
inline std::int64_t label_from(const std::string& text) {
  const auto label = parse_int64(text);
  if (!label) throw_wrong_kind();
  return *label;
}

template <class T>
void read_field(const Json& json, std::optional<T>& value) {
  if (is_null(json) || (is_string(json) && std::is_same_v<T, double>)) {
    value.reset();
    return;
  }
  read(json, value.emplace());
}

template <class T>
void read_field(const Json& json, T& value) {
  read(json, value);
}

template <class T>
void read_members(const Json& json, T& value) {
  check_object(json);
  visit(value, [&](const auto& name, auto& member) {
    // RFC 9457 requires no member of a problem. Other lists are omitted if empty.
    using Member = std::remove_reference_t<decltype(member)>;
    constexpr bool kMayHaveNoList = std::is_same_v<T, Volume> || std::is_same_v<T, MeshSummary> ||
                                    std::is_same_v<T, Estimate> || std::is_same_v<T, DicomIdentity>;
    constexpr bool kMayBeMissing = std::is_same_v<T, Problem> || kIsOptional<Member> ||
                                   (kMayHaveNoList && !std::is_same_v<Member, std::string> &&
                                    requires { member.emplace_back(); });
    const char* const key = name;
    if (const Json* found = find(json, key)) {
      read_field(*found, member);
    } else if (!kMayBeMissing && !may_be_absent(name)) {
      throw Error(ErrorCode::kInternal, std::string("lacks ") + key);
    }
  });
  if constexpr (std::is_base_of_v<MeshParameters, T>) {
    const Json* const iso = find(json, rows::kIso.name);
    const bool is_word = iso != nullptr && is_string(*iso);
    value.preset = is_word && text(*iso) != rows::kIso.when_empty ? text(*iso) : "";
  }
}

template <class T>
void read(const Json& json, T& value) {
  if constexpr (std::is_same_v<T, SchemeName>) {
    const auto known =
        from_string<SchemeName>(is_string(json) ? text(json) : std::to_string(whole(json, 9)));
    if (!known) throw Error(ErrorCode::kInternal, "has an unknown value");
    value = *known;
  } else if constexpr (Numbered<T>) {
    value = static_cast<T>(whole(json, static_cast<std::uint64_t>(last_of(value))));
  } else if constexpr (Enumeration<T>) {
    const auto known = from_string<T>(text(json));
    if (!known) throw Error(ErrorCode::kInternal, "has an unknown value");
    value = *known;
  } else if constexpr (kIsPerFormat<T>) {
    for_each_member(json, [&](const std::string& name, const Json& file) {
      if (const auto format = from_string<MeshFormat>(name)) read(file, value[*format]);
    });
  } else if constexpr (kIsPerLabel<T>) {
    for_each_member(json, [&](const std::string& name, const Json& of_label) {
      read(of_label, value[label_from(name)]);
    });
  } else if constexpr (std::is_same_v<T, LabelChoice>) {
    if (!is_string(json) || text(json) != kAllLabels) read(json, value.values);
  } else if constexpr (std::is_same_v<T, bool>) {
    value = boolean(json);
  } else if constexpr (std::is_floating_point_v<T>) {
    value = static_cast<T>(number(json));
  } else if constexpr (std::is_unsigned_v<T>) {
    value = static_cast<T>(whole(json, std::numeric_limits<T>::max()));
  } else if constexpr (std::is_integral_v<T>) {
    using Limits = std::numeric_limits<T>;
    value = static_cast<T>(whole(json, std::int64_t{Limits::min()}, std::int64_t{Limits::max()}));
  } else if constexpr (std::is_same_v<T, std::string> || Path<T>) {
    value = text(json);
  } else if constexpr (Duration<T>) {
    typename T::rep count = 0;
    read(json, count);
    value = T(count);
  } else if constexpr (requires { value.emplace_back(); }) {
    value.clear();
    const std::size_t size = array_size(json);
    for (std::size_t i = 0; i < size; ++i) read(element(json, i), value.emplace_back());
  } else if constexpr (requires { value.begin(); }) {
    for (std::size_t i = 0; i < value.size(); ++i) read(element(json, i), value[i]);
  } else {
    read_members(json, value);
  }
}

template <class T>
concept WithId = requires(const T& value) {
  is_id(value.id);
};

// False if a text is no id, where the value has its own or names another object. An empty text
// names none.
template <class T>
bool has_ids(const T& value) {
  const auto names_one = [](const std::optional<std::string>& id) {
    return !id || id->empty() || is_id(*id);
  };
  bool has = true;
  if constexpr (WithId<T>) has = is_id(value.id);
  if constexpr (requires { names_one(value.volume); }) has = has && names_one(value.volume);
  if constexpr (requires { names_one(value.job); }) has = has && names_one(value.job);
  if constexpr (requires { names_one(value.label_volume); }) {
    has = has && names_one(value.label_volume);
  }
  if constexpr (requires { value.parameters; }) has = has && has_ids(value.parameters);
  return has;
}

// Programs print ids for shells and give them to files. So no other text comes in as one: an object
// with such an id fails, and in a list it is left out.
template <class T>
void check_ids(T& value) {
  if constexpr (std::is_class_v<T>) {
    if (!has_ids(value)) throw Error(ErrorCode::kInternal, "has an id that cannot be one");
  }
  if constexpr (std::is_same_v<T, UploadedVolume>) {
    if (value.volume) check_ids(*value.volume);
  } else if constexpr (requires { value.emplace_back(); }) {
    if constexpr (WithId<typename T::value_type>) {
      std::erase_if(value, [](const auto& each) { return !has_ids(each); });
    } else {
      for (auto& each : value) check_ids(each);
    }
  }
}

template <class T>
T from_text(std::string_view text, const char* list = nullptr) {
  try {
    const JsonTree tree(text);
    const Json* const json = list == nullptr ? &tree.root() : find(tree.root(), list);
    if (json == nullptr) throw Error(ErrorCode::kInternal, std::string("lacks ") + list);
    T value{};
    read(*json, value);
    check_ids(value);
    return value;
  } catch (const Error& error) {
    throw error.with_detail(std::string("the server's response ") + error.what());
  }
}

template <class T>
void fill_with_defaults(Json& record) {
  static const JsonTree defaults = [] {
    JsonTree tree;
    write(tree.root(), T{});
    return tree;
  }();
  fill(record, defaults.root());
}

// The members that every version writes. Volumes of older versions have no digest, so a wrong byte
// in the name of one would give it its default.
inline void check_oldest_members(const Json& volume) {
  for (const char* const name : {"format", "dims", "type", "spacing", "origin", "direction",
                                 "range", "suggested_iso", "bytes", "created"}) {
    existing(volume, name);
  }
}

// Reads the text of record_of(). Other members that an older version did not write have their
// defaults.
template <class T>
T from_record(std::string_view text) {
  try {
    JsonTree tree(without_digest(text));
    check_object(tree.root());
    if constexpr (std::is_same_v<T, Volume>) check_oldest_members(tree.root());
    fill_with_defaults<T>(tree.root());
    if constexpr (std::is_same_v<T, Job>) {
      fill_with_defaults<MeshSummary>(member(tree.root(), "mesh"));
    }
    if constexpr (std::is_same_v<T, Volume>) {
      if (find(tree.root(), "dicom") != nullptr) {
        fill_with_defaults<DicomIdentity>(member(tree.root(), "dicom"));
      }
    }
    T value{};
    read(tree.root(), value);
    return value;
  } catch (const Error&) {
    throw Error(ErrorCode::kInternal, "a record was not written by a version of this service");
  }
}

}  // namespace isomesh::json_values
