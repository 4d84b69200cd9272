#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include <isobrick/lattice.h>
#include <isobrick/store_reader.h>
#include <isobrick/transform.h>

// Members of PieceKey::mesh that meshes of all kinds have.

namespace isobrick::inline v0 {

/// Of this program.
std::string version_text();
/// By what samples of a level are recognised, wherever the store lies.
nlohmann::json samples_json(const StoreReader& store, int level);
nlohmann::json box_json(Box3 box);
nlohmann::json transform_json(const Transform& transform);

/// Throw nlohmann::json::exception for what is none.
Box3 box_of(const nlohmann::json& object);
Transform transform_of(const nlohmann::json& object);

}  // namespace isobrick
