# The target Troupe::troupe, for find_package(Troupe CONFIG). Two layouts are known: an installed one, with lib/ and
# include/, and a checkout, whose libraries cargo built. TROUPE_LIBRARY names another library file.
get_filename_component(_troupe "${CMAKE_CURRENT_LIST_DIR}" DIRECTORY)
find_path(TROUPE_INCLUDE_DIR troupe.h
    PATHS "${_troupe}/include" "${_troupe}/../../include" NO_DEFAULT_PATH)
find_library(TROUPE_LIBRARY NAMES troupe_c
    PATHS "${_troupe}/.." "${_troupe}/../../target/release" "${_troupe}/../../target/dist" "${_troupe}/../../target/debug"
    NO_DEFAULT_PATH)
if(NOT TROUPE_INCLUDE_DIR OR NOT TROUPE_LIBRARY)
    set(Troupe_FOUND FALSE)
    set(Troupe_NOT_FOUND_MESSAGE
        "the library is not built: cargo build --release -p troupe-c, or set TROUPE_LIBRARY to its file")
    return()
endif()
if(NOT TARGET Troupe::troupe)
    add_library(Troupe::troupe UNKNOWN IMPORTED)
    set_target_properties(Troupe::troupe PROPERTIES
        IMPORTED_LOCATION "${TROUPE_LIBRARY}"
        INTERFACE_INCLUDE_DIRECTORIES "${TROUPE_INCLUDE_DIR}")
    if(TROUPE_LIBRARY MATCHES "\\.a$")
        set_target_properties(Troupe::troupe PROPERTIES INTERFACE_LINK_LIBRARIES "pthread;dl;m")
    endif()
endif()
set(Troupe_FOUND TRUE)
