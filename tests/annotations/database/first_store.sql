BEGIN TRANSACTION;
CREATE TABLE annotations (
	id VARCHAR(64) NOT NULL, 
	photo_sha256 VARCHAR(64) NOT NULL, 
	position INTEGER NOT NULL, 
	category TEXT NOT NULL, 
	score FLOAT NOT NULL, 
	source TEXT NOT NULL, 
	box_x0 FLOAT NOT NULL, 
	box_y0 FLOAT NOT NULL, 
	box_x1 FLOAT NOT NULL, 
	box_y1 FLOAT NOT NULL, 
	azimuth FLOAT NOT NULL, 
	elevation FLOAT NOT NULL, 
	inplane FLOAT NOT NULL, 
	focal_px FLOAT NOT NULL, 
	principal_x FLOAT NOT NULL, 
	principal_y FLOAT NOT NULL, 
	t_z FLOAT NOT NULL, 
	cad_id TEXT NOT NULL, 
	cad_name TEXT NOT NULL, 
	box_iou FLOAT NOT NULL, 
	mask_iou FLOAT, 
	cad_probability FLOAT, 
	none_probability FLOAT, 
	cad_needs_review BOOLEAN DEFAULT 0 NOT NULL, 
	truncated BOOLEAN DEFAULT 0 NOT NULL, 
	tiny BOOLEAN DEFAULT 0 NOT NULL, 
	unsure BOOLEAN DEFAULT 0 NOT NULL, 
	document JSON NOT NULL, 
	CONSTRAINT pk_annotations PRIMARY KEY (id), 
	CONSTRAINT uq_annotations_photo_sha256_position UNIQUE (photo_sha256, position), 
	CONSTRAINT fk_annotations_photo_sha256_photos FOREIGN KEY(photo_sha256) REFERENCES photos (sha256) ON DELETE CASCADE
);
INSERT INTO "annotations" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96','f76880e7f784561991f6489d0333b76b1ee2833053d96e169057eb46e3761954',0,'car',0.875,'embedded',5.0,4.0,30.0,25.5,312.4,8.1,-1.5,50.0,17.5,14.75,2.0,'Set/cad-0.obj','CAD 0',0.93,0.81,0.5,0.3125,1,1,0,1,'{"detection": {"box": [5.0, 4.0, 30.0, 25.5], "category": "car", "score": 0.875, "source": "embedded", "alternatives": [{"category": "bus", "score": 0.1}, {"category": "van", "score": 0.025}], "rotation": {"azimuth": 311.0, "elevation": 7.0, "inplane": 0.0}, "mask": {"size": [30, 40], "counts": [162, 6, 22, 10, 18, 13, 16, 15, 14, 17, 13, 18, 11, 19, 11, 20, 10, 20, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 10, 20, 10, 20, 10, 19, 12, 18, 12, 17, 14, 15, 16, 13, 19, 10, 22, 6, 312]}, "truncated": true, "tiny": false, "unsure": true}, "pose": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5, "focal_px": 50.0, "principal_px": [17.5, 14.75], "t_z": 2.0, "R_cv_from_s": [[-0.6767950132861993, 0.02591579811161783, -0.7357152175938536], [0.08636243339623002, -0.9896844013354507, -0.11430798682144791], [-0.7310882573867639, -0.14090123193758258, 0.6675753161626456]], "K": [[50.0, 0.0, 17.5], [0.0, 50.0, 14.75], [0.0, 0.0, 1.0]]}, "cad": {"id": "Set/cad-0.obj", "name": "CAD 0", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "candidates": [{"rank": 1, "cad": {"id": "Set/cad-0.obj", "name": "CAD 0", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.9, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.9, "sm2": 0.3333333333333333}, "probability": 0.5}, {"rank": 2, "cad": {"id": "Set/cad-1.obj", "name": "CAD 1", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.8, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.8, "sm2": 0.3333333333333333}, "probability": 0.125}, {"rank": 3, "cad": {"id": "Set/cad-2.obj", "name": "CAD 2", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.7, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.7, "sm2": 0.3333333333333333}, "probability": 0.0625}], "hypotheses": [{"rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "score": 0.71, "probability": 0.6, "expected_error": 24.5, "needs_review": true}, {"rotation": {"azimuth": 132.4, "elevation": 8.1, "inplane": 0.0}, "score": 0.5, "probability": 0.4, "expected_error": null, "needs_review": false}], "none_probability": 0.3125, "cad_needs_review": true, "box_iou": 0.93, "mask_iou": 0.81, "seconds": {"detection": 0.1, "rotation": 0.3333333333333333}, "provenance": {"cadpose": "0.1.0", "stages": ["embedded", "vote"], "seed": 0, "gpu": null}}');
INSERT INTO "annotations" VALUES('3318a6711b99395e2a89f15a8e0bb83ccf02bf7f59463605bd20005ca02fcbae','f76880e7f784561991f6489d0333b76b1ee2833053d96e169057eb46e3761954',1,'car',0.875,'embedded',10.0,2.0,38.0,20.0,312.4,8.1,-1.5,56.0,24.0,11.0,2.0,'Set/cad-7.obj','CAD 7',0.93,0.81,NULL,NULL,0,1,0,1,'{"detection": {"box": [10.0, 2.0, 38.0, 20.0], "category": "car", "score": 0.875, "source": "embedded", "alternatives": [{"category": "bus", "score": 0.1}, {"category": "van", "score": 0.025}], "rotation": {"azimuth": 311.0, "elevation": 7.0, "inplane": 0.0}, "mask": {"size": [30, 40], "counts": [309, 4, 24, 8, 21, 10, 19, 12, 17, 14, 16, 14, 15, 16, 14, 16, 14, 16, 13, 18, 12, 18, 12, 18, 12, 18, 12, 18, 12, 18, 12, 18, 12, 18, 12, 18, 12, 18, 13, 16, 14, 16, 14, 16, 15, 14, 16, 14, 17, 12, 19, 10, 21, 8, 24, 4, 77]}, "truncated": true, "tiny": false, "unsure": true}, "pose": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5, "focal_px": 56.0, "principal_px": [24.0, 11.0], "t_z": 2.0, "R_cv_from_s": [[-0.6767950132861993, 0.02591579811161783, -0.7357152175938536], [0.08636243339623002, -0.9896844013354507, -0.11430798682144791], [-0.7310882573867639, -0.14090123193758258, 0.6675753161626456]], "K": [[56.0, 0.0, 24.0], [0.0, 56.0, 11.0], [0.0, 0.0, 1.0]]}, "cad": {"id": "Set/cad-7.obj", "name": "CAD 7", "category": "car", "licence": "LGPL", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": null, "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "candidates": [{"rank": 1, "cad": {"id": "Set/cad-7.obj", "name": "CAD 7", "category": "car", "licence": "LGPL", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": null, "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 1.0, "rotation": {"azimuth": 0.0, "elevation": 0.0, "inplane": 0.0}, "measures": {}, "probability": null}], "hypotheses": [{"rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "score": 0.71, "probability": 0.6, "expected_error": 24.5, "needs_review": true}, {"rotation": {"azimuth": 132.4, "elevation": 8.1, "inplane": 0.0}, "score": 0.5, "probability": 0.4, "expected_error": null, "needs_review": false}], "none_probability": null, "cad_needs_review": false, "box_iou": 0.93, "mask_iou": 0.81, "seconds": {"detection": 0.1, "rotation": 0.3333333333333333}, "provenance": {"cadpose": "0.1.0", "stages": ["embedded", "vote"], "seed": 0, "gpu": null}}');
INSERT INTO "annotations" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee','f775680438a8212a50e139b01c6935a0e621e0e8a7bcbdad1f58ef5e5026d7a5',0,'car',0.875,'embedded',5.0,4.0,30.0,25.5,312.4,8.1,-1.5,50.0,17.5,14.75,2.0,'Set/cad-0.obj','CAD 0',0.93,0.81,0.5,0.3125,1,1,0,1,'{"detection": {"box": [5.0, 4.0, 30.0, 25.5], "category": "car", "score": 0.875, "source": "embedded", "alternatives": [{"category": "bus", "score": 0.1}, {"category": "van", "score": 0.025}], "rotation": {"azimuth": 311.0, "elevation": 7.0, "inplane": 0.0}, "mask": {"size": [30, 40], "counts": [162, 6, 22, 10, 18, 13, 16, 15, 14, 17, 13, 18, 11, 19, 11, 20, 10, 20, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 9, 21, 10, 20, 10, 20, 10, 19, 12, 18, 12, 17, 14, 15, 16, 13, 19, 10, 22, 6, 312]}, "truncated": true, "tiny": false, "unsure": true}, "pose": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5, "focal_px": 50.0, "principal_px": [17.5, 14.75], "t_z": 2.0, "R_cv_from_s": [[-0.6767950132861993, 0.02591579811161783, -0.7357152175938536], [0.08636243339623002, -0.9896844013354507, -0.11430798682144791], [-0.7310882573867639, -0.14090123193758258, 0.6675753161626456]], "K": [[50.0, 0.0, 17.5], [0.0, 50.0, 14.75], [0.0, 0.0, 1.0]]}, "cad": {"id": "Set/cad-0.obj", "name": "CAD 0", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "candidates": [{"rank": 1, "cad": {"id": "Set/cad-0.obj", "name": "CAD 0", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.9, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.9, "sm2": 0.3333333333333333}, "probability": 0.5}, {"rank": 2, "cad": {"id": "Set/cad-1.obj", "name": "CAD 1", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.8, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.8, "sm2": 0.3333333333333333}, "probability": 0.125}, {"rank": 3, "cad": {"id": "Set/cad-2.obj", "name": "CAD 2", "category": "car", "licence": "CC-BY-3.0", "creator": "A. Maker", "source": "Sweet Home 3D Set.sh3f", "size_cm": [170.5, 420.0, 150.25], "face_count": 1234, "sha256": "abababababababababababababababababababababababababababababababab"}, "score": 0.7, "rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "measures": {"cosine": 0.7, "sm2": 0.3333333333333333}, "probability": 0.0625}], "hypotheses": [{"rotation": {"azimuth": 312.4, "elevation": 8.1, "inplane": -1.5}, "score": 0.71, "probability": 0.6, "expected_error": 24.5, "needs_review": true}, {"rotation": {"azimuth": 132.4, "elevation": 8.1, "inplane": 0.0}, "score": 0.5, "probability": 0.4, "expected_error": null, "needs_review": false}], "none_probability": 0.3125, "cad_needs_review": true, "box_iou": 0.93, "mask_iou": 0.81, "seconds": {"detection": 0.1, "rotation": 0.3333333333333333}, "provenance": {"cadpose": "0.1.0", "stages": ["embedded", "vote"], "seed": 0, "gpu": null}}');
CREATE TABLE candidates (
	annotation_id VARCHAR(64) NOT NULL, 
	rank INTEGER NOT NULL, 
	cad_id TEXT NOT NULL, 
	cad_name TEXT NOT NULL, 
	cad_category TEXT NOT NULL, 
	score FLOAT NOT NULL, 
	azimuth FLOAT NOT NULL, 
	elevation FLOAT NOT NULL, 
	inplane FLOAT NOT NULL, 
	measures JSON NOT NULL, 
	probability FLOAT, 
	CONSTRAINT pk_candidates PRIMARY KEY (annotation_id, rank), 
	CONSTRAINT fk_candidates_annotation_id_annotations FOREIGN KEY(annotation_id) REFERENCES annotations (id) ON DELETE CASCADE
);
INSERT INTO "candidates" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96',1,'Set/cad-0.obj','CAD 0','car',0.9,312.4,8.1,-1.5,'{"cosine": 0.9, "sm2": 0.3333333333333333}',0.5);
INSERT INTO "candidates" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96',2,'Set/cad-1.obj','CAD 1','car',0.8,312.4,8.1,-1.5,'{"cosine": 0.8, "sm2": 0.3333333333333333}',0.125);
INSERT INTO "candidates" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96',3,'Set/cad-2.obj','CAD 2','car',0.7,312.4,8.1,-1.5,'{"cosine": 0.7, "sm2": 0.3333333333333333}',0.0625);
INSERT INTO "candidates" VALUES('3318a6711b99395e2a89f15a8e0bb83ccf02bf7f59463605bd20005ca02fcbae',1,'Set/cad-7.obj','CAD 7','car',1.0,0.0,0.0,0.0,'{}',NULL);
INSERT INTO "candidates" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee',1,'Set/cad-0.obj','CAD 0','car',0.9,312.4,8.1,-1.5,'{"cosine": 0.9, "sm2": 0.3333333333333333}',0.5);
INSERT INTO "candidates" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee',2,'Set/cad-1.obj','CAD 1','car',0.8,312.4,8.1,-1.5,'{"cosine": 0.8, "sm2": 0.3333333333333333}',0.125);
INSERT INTO "candidates" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee',3,'Set/cad-2.obj','CAD 2','car',0.7,312.4,8.1,-1.5,'{"cosine": 0.7, "sm2": 0.3333333333333333}',0.0625);
CREATE TABLE failures (
	photo_sha256 VARCHAR(64) NOT NULL, 
	position INTEGER NOT NULL, 
	category TEXT NOT NULL, 
	score FLOAT NOT NULL, 
	box_x0 FLOAT NOT NULL, 
	box_y0 FLOAT NOT NULL, 
	box_x1 FLOAT NOT NULL, 
	box_y1 FLOAT NOT NULL, 
	stage TEXT NOT NULL, 
	reason TEXT NOT NULL, 
	truncated BOOLEAN DEFAULT 0 NOT NULL, 
	tiny BOOLEAN DEFAULT 0 NOT NULL, 
	unsure BOOLEAN DEFAULT 0 NOT NULL, 
	document JSON NOT NULL, 
	CONSTRAINT pk_failures PRIMARY KEY (photo_sha256, position), 
	CONSTRAINT fk_failures_photo_sha256_photos FOREIGN KEY(photo_sha256) REFERENCES photos (sha256) ON DELETE CASCADE
);
INSERT INTO "failures" VALUES('f76880e7f784561991f6489d0333b76b1ee2833053d96e169057eb46e3761954',0,'zebra',0.5,1.0,2.0,30.0,28.0,'library','the library has no zebra',0,1,0,'{"detection": {"box": [1.0, 2.0, 30.0, 28.0], "category": "zebra", "score": 0.5, "source": "user", "alternatives": [], "rotation": null, "mask": null, "truncated": false, "tiny": true, "unsure": false}, "reason": "the library has no zebra", "stage": "library"}');
CREATE TABLE hypotheses (
	annotation_id VARCHAR(64) NOT NULL, 
	rank INTEGER NOT NULL, 
	azimuth FLOAT NOT NULL, 
	elevation FLOAT NOT NULL, 
	inplane FLOAT NOT NULL, 
	score FLOAT NOT NULL, 
	probability FLOAT NOT NULL, 
	expected_error FLOAT, 
	needs_review BOOLEAN DEFAULT 0 NOT NULL, 
	CONSTRAINT pk_hypotheses PRIMARY KEY (annotation_id, rank), 
	CONSTRAINT fk_hypotheses_annotation_id_annotations FOREIGN KEY(annotation_id) REFERENCES annotations (id) ON DELETE CASCADE
);
INSERT INTO "hypotheses" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96',1,312.4,8.1,-1.5,0.71,0.6,24.5,1);
INSERT INTO "hypotheses" VALUES('d1906fac6274ef945bb56e4054e91a7488d351d10c51dcde599931d420001b96',2,132.4,8.1,0.0,0.5,0.4,NULL,0);
INSERT INTO "hypotheses" VALUES('3318a6711b99395e2a89f15a8e0bb83ccf02bf7f59463605bd20005ca02fcbae',1,312.4,8.1,-1.5,0.71,0.6,24.5,1);
INSERT INTO "hypotheses" VALUES('3318a6711b99395e2a89f15a8e0bb83ccf02bf7f59463605bd20005ca02fcbae',2,132.4,8.1,0.0,0.5,0.4,NULL,0);
INSERT INTO "hypotheses" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee',1,312.4,8.1,-1.5,0.71,0.6,24.5,1);
INSERT INTO "hypotheses" VALUES('63bf3dbd1e812380e50d0278b74e0cc959aa1728fb0369b3406efd8bec5a60ee',2,132.4,8.1,0.0,0.5,0.4,NULL,0);
CREATE TABLE photos (
	sha256 VARCHAR(64) NOT NULL, 
	name TEXT NOT NULL, 
	width INTEGER NOT NULL, 
	height INTEGER NOT NULL, 
	schema_version VARCHAR(64) NOT NULL, 
	content_sha256 VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_photos PRIMARY KEY (sha256), 
	CONSTRAINT ck_photos_size CHECK (width > 0 AND height > 0)
);
INSERT INTO "photos" VALUES('f76880e7f784561991f6489d0333b76b1ee2833053d96e169057eb46e3761954','old/a.jpg',40,30,'cadpose.annotation/1','59dbfdb59069c5eb93ee6f84a94ac051df7eb40cfc7ea1aa38ac86604e48cf4e');
INSERT INTO "photos" VALUES('f775680438a8212a50e139b01c6935a0e621e0e8a7bcbdad1f58ef5e5026d7a5','old/b.jpg',40,30,'cadpose.annotation/1','a42bd270188da61e7d7ae5ec64e0d7f51ef2e7a1e1a16245341ff11ccda2c697');
INSERT INTO "photos" VALUES('d6993dcc91a78209250d8f393b63cf6b209c24f7d069726f6ad6ef0edb621e05','old/empty.jpg',40,30,'cadpose.annotation/1','4a354f716f871142cf7fd72364d2a2edbeb8546ffdc1ff8fdfc577f6066d5f8b');
CREATE INDEX ix_annotations_category ON annotations (category);
CREATE INDEX ix_annotations_cad_id ON annotations (cad_id);
CREATE INDEX ix_failures_category ON failures (category);
CREATE INDEX ix_candidates_cad_id ON candidates (cad_id);
COMMIT;
