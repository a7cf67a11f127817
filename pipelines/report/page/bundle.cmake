# Bundles the report pages with their libraries. The packages are fetched once, into the build folder.
set(report_page ${CMAKE_CURRENT_SOURCE_DIR}/report/page)
set(report_build ${PROJECT_BINARY_DIR}/report_page)
set(report_files build.js package.json package-lock.json clip.css clip.html clip.js report.css
    report.html report.js)
list(TRANSFORM report_files PREPEND ${report_page}/ OUTPUT_VARIABLE report_sources)
add_custom_command(
  OUTPUT ${report_build}/packages.stamp
  COMMAND ${CMAKE_COMMAND} -E make_directory ${report_build}
  COMMAND ${CMAKE_COMMAND} -E copy ${report_page}/package.json ${report_page}/package-lock.json
          ${report_build}
  COMMAND ${CMAKE_COMMAND} -E chdir ${report_build} ${NPM_PROGRAM} ci --ignore-scripts --no-audit
          --no-fund --loglevel=error
  COMMAND ${CMAKE_COMMAND} -E touch ${report_build}/packages.stamp
  DEPENDS ${report_page}/package.json ${report_page}/package-lock.json
  COMMENT "Fetching the packages of the report page (npm ci)"
  VERBATIM)
add_custom_command(
  OUTPUT ${report_build}/report_page.cc ${report_build}/clip_page.cc
  COMMAND ${CMAKE_COMMAND} -E copy ${report_sources} ${report_build}
  COMMAND ${NODE_PROGRAM} ${report_build}/build.js report kReportPage ${report_build}/report_page.cc
  COMMAND ${NODE_PROGRAM} ${report_build}/build.js clip kClipPage ${report_build}/clip_page.cc
  DEPENDS ${report_sources} ${report_build}/packages.stamp
  COMMENT "Bundling the report pages"
  VERBATIM)
